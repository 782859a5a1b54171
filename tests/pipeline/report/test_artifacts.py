"""Files to look at: what they show is what results.json says, they need nothing else, and are the same
each time.
"""

import csv
import json
import re
from base64 import b64decode
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

import pipeline
from pipeline.core.mesh import Mesh
from pipeline.core.reference import Reference
from pipeline.core.results import MadeBy, Note, RegistrationResult
from pipeline.kernels.remesh import MANY_FACES
from pipeline.report import writers
from pipeline.report.colormap import ColourScale
from pipeline.report.glb import NOT_COUNTED, DisplayMesh, write_glb
from pipeline.report.sections import legend
from pipeline.report.shots import FOOT_PX, shoot
from tests.support.meshes import blob_stl
from tests.support.settings import FAST as SMALL
from tests.support.shapes import icosphere

EXAMPLE = Path(__file__).parents[3] / "openapi" / "examples" / "results.registration.json"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RegistrationResult]:
    folder = tmp_path_factory.mktemp("job")
    (folder / "d.stl").write_bytes(blob_stl())
    (folder / "s.stl").write_bytes(blob_stl(23, 37, turn_deg=25.0, shift_mm=(4.0, -3.0, 2.0)))
    settings = pipeline.Settings.model_validate(SMALL)
    result = pipeline.register(
        folder / "d.stl", folder / "s.stl", settings=settings, tolerance_mm=0.05, out=folder / "out"
    )
    return folder, result


class Outline(HTMLParser):
    """What a page is made of, and whether its tags close."""

    VOID = frozenset({"meta", "img", "rect", "line", "br", "link", "input", "path", "circle"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def outline(text: str) -> Outline:
    parser = Outline()
    parser.feed(text)
    assert parser.open == []
    return parser


def test_every_file_that_is_listed_is_there_and_no_other(made: tuple[Path, RegistrationResult]) -> None:
    folder, result = made
    assert result.verdict.status == "ok"
    assert sorted(path.name for path in (folder / "out").iterdir()) == result.files
    assert {"deviation.ply", "deviation.glb", "design.glb", "deviation_histogram.svg", "report.html"} <= set(
        result.files
    )


def test_the_page_is_whole_alone_and_says_what_the_results_say(made: tuple[Path, RegistrationResult]) -> None:
    folder, result = made
    text = (folder / "out" / "report.html").read_text()
    page = outline(text)
    assert not [tag for tag, _ in page.tags if tag in ("script", "link", "iframe")]
    sources = [str(attributes["src"]) for tag, attributes in page.tags if tag == "img"]
    assert len(sources) >= 8 and all(source.startswith("data:image/") for source in sources)
    assert not re.search(r"(?:src|href)=\"(?!data:)", text) and "url(" not in text
    assert all(attributes.get("alt") for tag, attributes in page.tags if tag == "img")
    assert result.deviation is not None
    for words in (
        f"{result.deviation.rms_mm:.3f} mm",
        f"{100 * (result.deviation.within or 0):.1f} %",
        result.provenance.inputs.scan.sha256,
    ):
        assert words in text
    assert b64decode(sources[0].partition(",")[2]).startswith(b"\x89PNG")


def test_words_from_outside_stay_words(tmp_path: Path) -> None:
    """A note with markup in it, as a file's own unit might bring in, is text on the page."""
    from pipeline.report.page import _render

    text = _render(
        *("<script>alert(1)</script>", [], [Note(code="x", detail="<img src=x onerror=y>")]),
        inputs={},
        made_by=MadeBy(version="0", libraries={}, settings={}, seed=0),
        subtitle="a & b",
    )
    assert "<script>" not in text and "&lt;script&gt;" in text and "<img src=x" not in text


def test_the_coloured_scan_is_the_aligned_one_in_the_scales_colours(
    made: tuple[Path, RegistrationResult],
) -> None:
    folder, result = made
    aligned = trimesh.load(folder / "out" / "aligned.ply", process=False)
    coloured = trimesh.load(folder / "out" / "deviation.ply", process=False)
    assert np.array_equal(aligned.vertices, coloured.vertices) and np.array_equal(
        aligned.faces, coloured.faces
    )
    design = trimesh.load(folder / "out" / "design.clean.ply", process=False)
    signed = -trimesh.proximity.signed_distance(design, aligned.vertices[:50])  # trimesh: + inside
    scale = ColourScale(2.0, 0.05)
    away = np.abs(signed) > 0.06
    painted = coloured.visual.vertex_colors[:50, :3] / 255
    is_red = painted[:, 0] > painted[:, 2] + 1e-9
    assert np.array_equal(is_red[away], signed[away] > 0)
    assert scale.limit_mm > 0
    viewed = trimesh.load(folder / "out" / "deviation.glb", process=False).geometry["surface"]
    assert np.allclose(viewed.vertices * 1000, aligned.vertices, atol=1e-3)  # glTF is in metres
    shown = trimesh.load(folder / "out" / "design.glb")
    assert set(shown.geometry) == {"surface", "landmarks"}
    assert result.transform is not None


def test_a_large_mesh_is_decimated_for_viewers_only(tmp_path: Path) -> None:
    ball = icosphere(10.0, 7)
    assert len(ball.faces) > MANY_FACES
    height = (ball.vertices[:, 2] + 10) / 20
    write_glb(tmp_path / "a.glb", DisplayMesh(ball), np.column_stack([height, height, height]))
    seen = trimesh.load(tmp_path / "a.glb", process=False).geometry["surface"]
    assert 10_000 < len(seen.faces) <= MANY_FACES
    assert np.linalg.norm(seen.vertices, axis=1) * 1000 == pytest.approx(10, abs=0.05)
    expected = (seen.vertices[:, 2] * 1000 + 10) / 20
    assert np.abs(seen.visual.vertex_colors[:, 0] / 255 - expected).max() < 0.03


def test_a_cloud_has_its_colours_too(tmp_path: Path) -> None:
    cloud = Mesh(icosphere(5.0, 2).vertices, np.zeros((0, 3), dtype=np.int32))
    write_glb(tmp_path / "a.glb", DisplayMesh(cloud), np.tile([1.0, 0, 0], (len(cloud.vertices), 1)))
    seen = trimesh.load(tmp_path / "a.glb").geometry["surface"]
    assert len(seen.vertices) == len(cloud.vertices) and (seen.colors[:, :3] == [255, 0, 0]).all()


def test_a_cloud_has_its_deviations_too(tmp_path: Path) -> None:
    """Read by the text of the format, as trimesh reads no attributes of points."""
    cloud = Mesh(icosphere(5.0, 2).vertices, np.zeros((0, 3), dtype=np.int32))
    deviation_mm = np.linspace(-1.0, 1.0, len(cloud.vertices))
    deviation_mm[3] = np.nan
    red = np.tile([1.0, 0, 0], (len(cloud.vertices), 1))
    write_glb(tmp_path / "a.glb", DisplayMesh(cloud), red, deviation_mm=deviation_mm)
    data = (tmp_path / "a.glb").read_bytes()
    length = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + length])
    number = tree["meshes"][0]["primitives"][0]["attributes"]["_DEVIATION_MM"]
    accessor = tree["accessors"][number]
    view = tree["bufferViews"][accessor["bufferView"]]
    start = 20 + length + 8 + view["byteOffset"]
    values = np.frombuffer(data[start : start + view["byteLength"]], dtype="<f4")
    assert (accessor["count"], accessor["type"], accessor["componentType"]) == (len(values), "SCALAR", 5126)
    assert np.allclose(values[np.arange(len(values)) != 3], np.delete(deviation_mm, 3), atol=1e-6)
    assert values[3] == np.float32(NOT_COUNTED)
    assert len(trimesh.load(tmp_path / "a.glb").geometry["surface"].vertices) == len(cloud.vertices)


def test_a_scan_that_does_not_fit_has_a_page_without_deviation(tmp_path: Path) -> None:
    (tmp_path / "d.stl").write_bytes(blob_stl())
    trimesh.creation.cylinder(1.0, 60.0, sections=40).export(tmp_path / "s.stl")
    settings = pipeline.Settings.model_validate(SMALL)
    result = pipeline.register(
        tmp_path / "d.stl", tmp_path / "s.stl", settings=settings, out=tmp_path / "out"
    )
    assert result.transform is None and "deviation.ply" not in result.files
    text = (tmp_path / "out" / "report.html").read_text()
    outline(text)
    assert "Deviation of the scan" not in text and result.verdict.status.replace("_", " ") in text
    # What was tried is shown for what it is, and both meshes with their sizes: why they do not fit can be
    # seen.
    assert (
        "Not a measurement" in text
        and "material is missing" not in text
        and text.count("data:image/png") == 8
    )
    assert "scan 2.0 x 2.0 x 60.0 mm along the axes of its file" in text


def test_the_page_says_the_size_of_both_in_one_frame(made: tuple[Path, RegistrationResult]) -> None:
    folder, _ = made
    text = (folder / "out" / "report.html").read_text()
    said = re.search(r"Design (.*) mm along the axes of its file; scan (.*) mm along the same axes", text)
    assert said is not None
    for words, name in zip(said.groups(), ("design.clean.ply", "aligned.ply"), strict=True):
        extents = np.ptp(trimesh.load(folder / "out" / name, process=False).vertices, axis=0)
        assert [float(word) for word in words.split(" x ")] == pytest.approx(extents, abs=0.051)


def test_a_scan_larger_than_its_design_is_not_cut_off_and_the_scale_bar_is_true() -> None:
    ball, design = icosphere(10.0, 4), icosphere(2.0, 2)
    for shot in shoot(ball, np.zeros((len(ball.vertices), 3)), design, ["+z", "oblique"]):
        image = np.asarray(Image.open(BytesIO(shot.data)).convert("L"))
        rim = np.concatenate([image[0], image[-FOOT_PX], image[:, 0], image[:, -1]])
        assert (rim == 255).all() and (image < 255).any()
        across_px = np.ptp(np.flatnonzero((image < 255).any(axis=0))) + 1
        mm_per_px = float(shot.bar_words.split()[0]) / shot.bar_px
        assert across_px * mm_per_px == pytest.approx(20.0, rel=0.01)


@pytest.mark.parametrize("tolerance_mm", [None, 0.05, 0.4, 0.5])
def test_words_of_the_legend_lie_apart_and_are_where_the_colour_is(tolerance_mm: float | None) -> None:
    shown = legend(ColourScale(1.0, tolerance_mm), "closed")
    shares = [share for share, _ in shown.ticks]
    assert shares[0] == 0 and shares[-1] == 1 and np.diff(shares).min() > 0.08
    for share, words in shown.ticks:
        if words.startswith("±"):
            assert share == 0.5 and words == f"±{tolerance_mm:g} mm"
        elif words != "0":
            assert float(words.split()[0].replace("\N{MINUS SIGN}", "-")) == pytest.approx(
                2 * share - 1, abs=1e-3
            )


def test_where_distances_have_no_sign_the_legend_promises_none() -> None:
    assert "missing" not in legend(ColourScale(1.0, None), "none").words
    assert "missing" in legend(ColourScale(1.0, None), "closed").words


def test_an_open_surface_has_sides_and_no_material() -> None:
    words = legend(ColourScale(1.0, None), "open").words
    assert "missing" not in words and "face normals" in words


def test_landmarks_and_studies_have_a_page(tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_bytes(blob_stl())
    settings = pipeline.Settings.model_validate(SMALL)
    marked = pipeline.find_landmarks(tmp_path / "m.stl", settings=settings, out=tmp_path / "landmarks")
    text = (tmp_path / "landmarks" / "report.html").read_text()
    outline(text)
    assert f"{len(marked.landmarks.mesh)} landmarks" in text
    done = pipeline.study(
        tmp_path / "m.stl", trials=20, detectors=["t2"], settings=settings, out=tmp_path / "study"
    )
    text = (tmp_path / "study" / "report.html").read_text()
    outline(text)
    assert done.summary[:40] in text.replace("&#39;", "'") and "report.html" in done.files


def test_characteristics_are_read_back_as_they_were_written(tmp_path: Path) -> None:
    inspection = RegistrationResult.model_validate_json(EXAMPLE.read_text()).inspection
    assert inspection is not None
    path = tmp_path / "characteristics.csv"
    writers.write_characteristics(path, inspection.checks, Reference(serial='A-17, "b"'))
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["name"] for row in rows] == [check.name for check in inspection.checks]
    assert {row["serial"] for row in rows} == {'A-17, "b"'}
    for row, check in zip(rows, inspection.checks, strict=True):
        assert float(row["value"]) == check.value
        assert row["lower"] == ("" if check.lower is None else repr(check.lower))
        assert row["result"] == "passed"
    writers.write_characteristics(path, inspection.checks, None)
    assert path.read_text().splitlines()[1].startswith(",,,,,,,")
