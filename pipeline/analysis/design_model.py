"""The model of a design: everything that follows from its file and the settings, and that serves every scan
of it.

It is computed once and can be cached in a file (`core.archive`): the next scan of the design does no design
work.
"""

import hashlib
import json
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from pipeline.analysis.inputs import InputMesh
from pipeline.analysis.mesh_analysis import Analysis, Scales, analyse_mesh, describe_mesh
from pipeline.analysis.symmetry_group import SymmetryGroup, find_symmetries
from pipeline.core import archive
from pipeline.core.brep_faces import BrepFaces
from pipeline.core.code_fingerprint import code_fingerprint
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.mesh_file import MeshFile
from pipeline.core.progress import Stage
from pipeline.core.results import Input, Note
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.kernels.surface import Surface
from pipeline.search.types import DescribedMesh, Descriptors


@dataclass(frozen=True, slots=True)
class CachedDesign:
    """What is stored of a design model.

    fingerprint : of everything it follows from; spread, descriptors : as in `DescribedMesh`; symmetries,
    approximate : (4, 4) each, as in `SymmetryGroup`; files : the artifacts of a job that are the design's
    alone, by name; brep : faces of the CAD model, on the triangles of the cleaned mesh
    """

    fingerprint: str
    input: Input
    warnings: tuple[Note, ...]
    analysis: Analysis
    spread: IndexArray
    descriptors: Descriptors
    symmetries: tuple[FloatArray, ...]
    approximate: tuple[FloatArray, ...]
    files: dict[str, bytes]
    brep: BrepFaces | None = None


class DesignModel:
    """The stored part, and what is quickly made of it on demand."""

    def __init__(self, cached: CachedDesign, settings: Settings) -> None:
        self.cached = cached
        self._settings = settings

    @property
    def analysis(self) -> Analysis:
        return self.cached.analysis

    @property
    def diagonal_mm(self) -> float:
        return self.analysis.mesh.diagonal_mm

    @cached_property
    def scales(self) -> Scales:
        return Scales.of(self.analysis.mesh, self._settings)

    @property
    def matching_mm(self) -> float:
        """The unit of length of matching."""
        return self.scales.matching_mm(self._settings)

    @cached_property
    def surface(self) -> Surface:
        return Surface(self.analysis.mesh)

    @cached_property
    def described(self) -> DescribedMesh:
        working, landmarks = self.analysis.resampled.mesh, self.analysis.landmarks
        return DescribedMesh(working, landmarks, self.cached.spread, self.cached.descriptors)

    @cached_property
    def symmetry(self) -> SymmetryGroup:
        return SymmetryGroup(self.surface, self.cached.symmetries, self.cached.approximate)

    def keep_files(self, files: dict[str, bytes]) -> None:
        """Store artifacts of the design with the model."""
        self.cached = replace(self.cached, files=files)

    def save(self, path: Path) -> None:
        """Store it for `load_design`."""
        archive.write(path, self.cached)


def load_design(path: Path, file: MeshFile, settings: Settings, seed: int) -> DesignModel | None:
    """The model stored at `path` if it is there, undamaged, and of this file, these settings and this
    code.
    """
    try:
        cached = archive.read(path, CachedDesign)
    except (FileNotFoundError, archive.NotAnArchive):
        return None
    return DesignModel(cached, settings) if cached.fingerprint == fingerprint(file, settings, seed) else None


def build_design(
    design: InputMesh, design_fingerprint: str, settings: Settings, timer: StageTimer, seed: int
) -> DesignModel:
    """Analyse a design up to the landmarks, then compute what matching and the verdict need of it.

    design_fingerprint : see `fingerprint`
    """
    scales = Scales.of(design.mesh, settings)
    analysis = analyse_mesh(design.mesh, "design", scales, settings, timer, seed).without_fine_mesh()
    with timer.stage(Stage.MATCHING, "design"):
        described = describe_mesh(analysis, scales, settings)
        length_mm = scales.matching_mm(settings)
        symmetry = find_symmetries(Surface(design.mesh), described, length_mm, settings.matching, seed)
    cached = CachedDesign(
        fingerprint=design_fingerprint,
        input=design.record(),
        warnings=tuple(design.warnings()),
        analysis=analysis,
        spread=described.spread,
        descriptors=described.descriptors,
        symmetries=symmetry.elements,
        approximate=symmetry.approximate,
        files={},
        brep=design.brep_faces(),
    )
    return DesignModel(cached, settings)


def fingerprint(file: MeshFile, settings: Settings, seed: int) -> str:
    """SHA-256 (hex) of everything that a design model follows from: file, unit, settings, seed and code."""
    with file.path.open("rb") as content:
        content_sha256 = hashlib.file_digest(content, "sha256").hexdigest()
    ending = Path(file.filename or file.path.name).suffix.lower()
    # what changes nothing of the analysis of a design
    later = {"registration", "deviation", "study", "report"}
    method = settings.model_dump(mode="json", exclude=later)
    sources = [content_sha256, ending, file.unit, file.part, file.columns, method, seed, code_fingerprint()]
    return hashlib.sha256(json.dumps(sources, sort_keys=True).encode()).hexdigest()
