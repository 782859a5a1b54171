"""Why the pipeline could not go on, in words for whoever uploaded the mesh: which file, what is wrong, what to do.

"Could not converge" and "cannot tell" are not here: they are results (see `outcome.Verdict`).
"""

from typing import ClassVar

from pipeline.core.progress import Stage


class PipelineError(Exception):
    """Base of everything the door raises on purpose.

    stage : where it happened; code : stable word for machines; reason : what is wrong; remedy : what to do;
    mesh : which input it is about (`design`, `scan`, `mesh`), None when about no single one.
    """

    stage: ClassVar[Stage] = Stage.LOAD
    code: ClassVar[str] = "pipeline_error"
    default_remedy: ClassVar[str] = ""

    def __init__(self, reason: str, *, mesh: str | None = None, remedy: str | None = None) -> None:
        self.reason = reason
        self.mesh = mesh
        self.remedy = self.default_remedy if remedy is None else remedy
        super().__init__(self.detail)

    @property
    def detail(self) -> str:
        """One sentence a person can act on: `scan: reason; remedy`."""
        subject = f"{self.mesh}: " if self.mesh else ""
        return f"{subject}{self.reason}" + (f"; {self.remedy}" if self.remedy else "")


class EmptyFile(PipelineError):
    code = "empty_file"
    default_remedy = "export the mesh again and check that the file is not zero bytes"


class UnknownFormat(PipelineError):
    code = "unknown_format"
    default_remedy = "send STL, PLY, OBJ, OFF, 3MF or GLB (a scan also as PLY or XYZ points)"


class TruncatedFile(PipelineError):
    code = "truncated_file"
    default_remedy = "the upload or the export was cut short: send the file again"


class UnreadableFile(PipelineError):
    code = "unreadable_file"
    default_remedy = "open the file in the program it came from and export it again"


class MeshTooLarge(PipelineError):
    code = "mesh_too_large"
    default_remedy = "decimate the mesh, or raise load.max_faces in the settings"


class NotFinite(PipelineError):
    code = "not_finite"
    default_remedy = "remove the NaN or infinite vertices in the program the file came from"


class CoordinateOutOfRange(PipelineError):
    code = "coordinate_out_of_range"
    default_remedy = (
        "remove stray vertices in the program the file came from, or say which unit it is in (options.units)"
    )


class IndexOutOfRange(PipelineError):
    code = "index_out_of_range"
    default_remedy = "the file is damaged or was written wrongly: export it again"


class NoSurface(PipelineError):
    code = "no_surface"
    default_remedy = "a design must have triangles: export it as a mesh, not as points"


class UnitUnknown(PipelineError):
    code = "unit_unknown"
    default_remedy = "say which unit the file is in: options.units, one of mm, cm, m, inch"


class DegenerateMesh(PipelineError):
    stage = Stage.CLEAN
    code = "degenerate_mesh"
    default_remedy = "check the export: the part needs a surface with some extent"


class TooFewPoints(PipelineError):
    stage = Stage.CLEAN
    code = "too_few_points"
    default_remedy = "send a denser scan"


class ResampleFailed(PipelineError):
    stage = Stage.RESAMPLE
    code = "resample_failed"
    default_remedy = "repair the mesh (self-intersections, slivers), or change resample.target_vertices"


class ComponentsTooSmall(PipelineError):
    stage = Stage.SEGMENTATION
    code = "components_too_small"
    default_remedy = "lower segmentation.min_component_share, or join the shells of the mesh"


class TooFewLandmarks(PipelineError):
    stage = Stage.STUDY
    code = "too_few_landmarks"
    default_remedy = "the surface has too little relief for a study of landmarks: lower landmarks.min_relief, or send another part"
