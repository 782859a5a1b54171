"""A design as it is before any scan comes: all of this follows from its file and the settings, and serves every scan of it.

It is computed once and can be kept in a file (`pipeline.core.archive`): the next scan of the design does no design work.
"""

import hashlib
import json
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path

from pipeline.analysis.mesh_analysis import Analysis, Scales, analyse, write_analysis
from pipeline.analysis.symmetry_group import SelfImages
from pipeline.api import MeshFile
from pipeline.core import archive
from pipeline.core.mesh import FloatArray
from pipeline.core.progress import Stage
from pipeline.core.results import Input, Note
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.kernels.surface import Surface
from pipeline.report import glb as viewing
from pipeline.stages.clean import Cleaned
from pipeline.stages.load import Loaded
from pipeline.stages.matching import Side
from pipeline.workflows import result_builders as records


@dataclass(frozen=True, slots=True)
class Kept:
    """What is kept of a design. fingerprint : of all it follows from; descriptors : of its working mesh; symmetries,
    near_symmetries : (4, 4) each; files : those of the job that are the design's alone, by name
    """

    fingerprint: str
    input: Input
    notes: tuple[Note, ...]
    analysis: Analysis
    descriptors: FloatArray
    symmetries: tuple[FloatArray, ...]
    near_symmetries: tuple[FloatArray, ...]
    files: dict[str, bytes]


class Design:
    """The design at work: what is kept, and what is quickly made of it."""

    def __init__(self, kept: Kept, settings: Settings) -> None:
        self.kept = kept
        self._settings = settings

    @property
    def analysis(self) -> Analysis:
        return self.kept.analysis

    @property
    def diagonal_mm(self) -> float:
        return self.analysis.mesh.diagonal_mm

    @cached_property
    def scales(self) -> Scales:
        return Scales.of(self.analysis.mesh, self._settings)

    @cached_property
    def light(self) -> viewing.DisplayMesh:
        return self.analysis.shown()

    @cached_property
    def surface(self) -> Surface:
        return Surface(self.analysis.mesh)

    @cached_property
    def side(self) -> Side:
        return Side(self.analysis.resampled.mesh, self.analysis.landmarks, self.kept.descriptors)

    @cached_property
    def images(self) -> SelfImages:
        return SelfImages(self.surface, self.kept.symmetries, self.kept.near_symmetries)

    def write(self, out: Path) -> list[str]:
        """Its files; returns their names."""
        if not self.kept.files:
            names = [*write_analysis(out, "design", self.analysis, self._settings), "design.glb"]
            marks = self.analysis.mesh.vertices[self.analysis.landmark_vertices]
            viewing.write_glb(out / "design.glb", self.light, self.analysis.segment_colours(), marks)
            self.kept = replace(self.kept, files={name: (out / name).read_bytes() for name in names})
        for name, content in self.kept.files.items():
            (out / name).write_bytes(content)
        return list(self.kept.files)

    def keep(self, path: Path) -> None:
        """For `kept_design`."""
        archive.write(path, self.kept)


def kept_design(path: Path, file: MeshFile, settings: Settings, seed: int) -> Design | None:
    """The design kept at `path`, if it is there, whole, and of this file, these settings and this version."""
    try:
        kept = archive.read(path, Kept)
    except (FileNotFoundError, archive.NotAnArchive):
        return None
    return Design(kept, settings) if kept.fingerprint == fingerprint(file, settings, seed) else None


def known(loaded: Loaded, cleaned: Cleaned, mark: str, settings: Settings, watch: StageTimer, seed: int) -> Design:
    """Stages up to the landmarks, then what matching and the verdict ask of a design. mark : its `fingerprint`"""
    scales = Scales.of(cleaned.mesh, settings)
    analysis = analyse(cleaned.mesh, "design", scales, settings, watch, seed)
    analysis = replace(analysis, resampled=replace(analysis.resampled, fine=None))  # features are had
    with watch.stage(Stage.MATCHING, "design"):
        side = described(analysis, scales, settings)
        length_mm = scales.matching_mm(settings)
        images = SelfImages.of(Surface(cleaned.mesh), side, length_mm, settings.matching, seed)
    kept = Kept(
        fingerprint=mark,
        input=records.input_record(loaded, cleaned),
        notes=tuple(records.input_warnings(design=cleaned)),
        analysis=analysis,
        descriptors=side.described(length_mm, settings.matching),
        symmetries=images.others,
        near_symmetries=images.near,
        files={},
    )
    return Design(kept, settings)


def fingerprint(file: MeshFile, settings: Settings, seed: int) -> str:
    """Of everything that a kept design follows from."""
    with file.path.open("rb") as content:
        of_content = hashlib.file_digest(content, "sha256").hexdigest()
    ending = Path(file.filename or file.path.name).suffix.lower()
    method = settings.model_dump(
        mode="json", exclude={"report"}
    )  # what is written beside changes nothing of it
    made_of = [of_content, ending, file.unit, method, seed, version("cusp")]
    return hashlib.sha256(json.dumps(made_of, sort_keys=True).encode()).hexdigest()


def described(analysis: Analysis, scales: Scales, settings: Settings) -> Side:
    """The mesh as matching sees it."""
    side = Side(analysis.resampled.mesh, analysis.landmarks)
    return replace(side, descriptors=side.described(scales.matching_mm(settings), settings.matching))
