"""A kept design saves its work and changes nothing; what is not it, is not taken."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pipeline
from pipeline import Settings
from pipeline.analysis.design_model import CachedDesign, fingerprint, load_design
from pipeline.core import archive
from pipeline.core.mesh import Mesh
from tests.support import shapes
from tests.support.designs import design_of
from tests.support.scans import save, scanned
from tests.support.settings import COARSE as QUICK
from tests.support.settings import FAST

DESIGN_STAGES = {"load", "clean", "resample", "geodesics", "segmentation", "features", "landmarks"}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("meshes")
    design = save(shapes.bumpy_blob(4), folder / "design.stl")
    return design, save(scanned(shapes.motion(4)), folder / "scan.ply")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "results.json"}


def test_results_and_files_are_the_same_with_a_load_design(files: tuple[Path, Path], tmp_path: Path) -> None:
    cache = tmp_path / "design.npz"
    outs = [tmp_path / name for name in ("without", "first", "second")]
    told: list[list[str]] = [[], [], []]
    results = [
        pipeline.register(
            *files,
            settings=Settings.model_validate(FAST),
            out=out,
            design_cache=None if number == 0 else cache,
            on_progress=lambda progress, number=number: told[number].append(progress.message),  # type: ignore[misc]
        )
        for number, out in enumerate(outs)
    ]
    assert cache.exists()
    plain = [result.model_dump(exclude={"timings_s"}) for result in results]
    assert plain[0] == plain[1] == plain[2]
    assert contents(outs[0]) == contents(outs[1]) == contents(outs[2])
    done_to_design = [
        {message.split(":")[0] for message in each if message.endswith(": design")} for each in told
    ]
    assert done_to_design[0] == done_to_design[1] >= DESIGN_STAGES
    assert done_to_design[2] == set()  # the second scan of a design does no design work


def test_what_is_kept_comes_back_to_the_bit(tmp_path: Path) -> None:
    kept = design_of(shapes.bumpy_blob(4), QUICK).cached
    archive.write(tmp_path / "kept.npz", kept)
    back = archive.read(tmp_path / "kept.npz", CachedDesign)
    assert back.analysis.mesh.vertices.tobytes() == kept.analysis.mesh.vertices.tobytes()
    assert back.descriptors.values.tobytes() == kept.descriptors.values.tobytes()
    assert back.spread.tobytes() == kept.spread.tobytes()
    assert back.analysis.landmarks.t2.tobytes() == kept.analysis.landmarks.t2.tobytes()
    assert back.analysis.segmentation.labels.dtype == kept.analysis.segmentation.labels.dtype
    assert back.analysis.resampled.fine is None
    assert (back.input, back.warnings, back.files) == (kept.input, kept.warnings, kept.files)


def test_another_design_other_settings_or_a_damaged_file_are_not_taken(
    files: tuple[Path, Path], tmp_path: Path
) -> None:
    mesh_file = pipeline.MeshFile(files[0])
    design = design_of(shapes.bumpy_blob(4), QUICK)
    path = tmp_path / "kept.npz"
    assert load_design(path, mesh_file, QUICK, 0) is None  # nothing there
    archive.write(path, design.cached)
    assert load_design(path, mesh_file, QUICK, 0) is None  # its fingerprint is another
    marks = {
        fingerprint(mesh_file, QUICK, 0),
        fingerprint(mesh_file, QUICK, 1),
        fingerprint(mesh_file, Settings(), 0),
        fingerprint(pipeline.MeshFile(files[0], unit="inch"), QUICK, 0),
        fingerprint(pipeline.MeshFile(files[1]), QUICK, 0),
    }
    assert len(marks) == 5
    for damage in (b"", b"PK\x03\x04 not a zip", path.read_bytes()[:1000]):
        path.write_bytes(damage)
        assert load_design(path, mesh_file, QUICK, 0) is None


@dataclass(frozen=True)
class Small:
    mesh: Mesh
    numbers: np.ndarray[tuple[int], np.dtype[np.float64]]
    words: tuple[str, ...]
    limit: float | None


SMALL = Small(shapes.icosphere(1.0, 1), np.arange(5.0), ("a", "b"), None)


@given(st.data())
def test_no_damage_to_an_archive_does_more_than_be_told(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("damaged") / "small.npz"
    archive.write(path, SMALL)
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    if data.draw(st.booleans()):
        content = content[:at]
    else:
        content[at] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    with suppress(archive.NotAnArchive):
        back = archive.read(path, Small)
        assert np.isfinite(back.mesh.vertices).all()


def test_an_archive_holds_no_pickle(tmp_path: Path) -> None:
    """An object array, which only a pickle could bring back, is refused on both ways."""
    path = tmp_path / "bad.npz"
    np.savez(path, meta=np.array([{"a": 1}], dtype=object))
    with pytest.raises(archive.NotAnArchive):
        archive.read(path, CachedDesign)
    with pytest.raises(TypeError, match="cannot contain"):
        archive.write(path, object())
