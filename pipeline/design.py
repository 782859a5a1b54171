"""A design as it is before any scan comes: all of this follows from its mesh and the settings, and serves every scan of it."""

from dataclasses import dataclass, replace

from pipeline.analysis import Analysis, Scales, analyse
from pipeline.kernels.surface import Surface
from pipeline.mesh import Mesh
from pipeline.progress import Stage
from pipeline.settings import Settings
from pipeline.stages.matching import Side
from pipeline.symmetries import SelfImages
from pipeline.watch import Watch


@dataclass(frozen=True, slots=True)
class Design:
    """surface : of the cleaned mesh; side : as matching sees it, described; images : its symmetries"""

    analysis: Analysis
    scales: Scales
    surface: Surface
    side: Side
    images: SelfImages

    @property
    def diagonal_mm(self) -> float:
        return self.analysis.mesh.diagonal_mm


def known(mesh: Mesh, settings: Settings, watch: Watch, seed: int) -> Design:
    """Stages up to the landmarks, then what matching and the verdict ask of a design. mesh : cleaned"""
    scales = Scales.of(mesh, settings)
    analysis = analyse(mesh, "design", scales, settings, watch, seed)
    surface = Surface(mesh)
    with watch.stage(Stage.MATCHING, "design"):
        side = described(analysis, scales, settings)
        length_mm = scales.matching_mm(settings)
        images = SelfImages.of(surface, side, length_mm, settings.matching, seed)
    return Design(analysis, scales, surface, side, images)


def described(analysis: Analysis, scales: Scales, settings: Settings) -> Side:
    """The mesh as matching sees it."""
    side = Side(analysis.resampled.mesh, analysis.landmarks)
    return replace(side, descriptors=side.described(scales.matching_mm(settings), settings.matching))
