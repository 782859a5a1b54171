"""Errors of the pipeline, with a message for the person who uploaded the mesh: file, cause and remedy.

A registration that does not converge or is ambiguous is a result, not an error (see `results.Verdict`).
"""

from typing import ClassVar

from pipeline.core.progress import Stage


class PipelineError(Exception):
    """Base class of all errors that the public API raises on purpose.

    stage : where the error occurred; code : stable identifier for programs; reason : the cause; remedy : what
    to do; mesh : the input concerned (`design`, `scan`, `mesh`), None if it is not a single one.
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
        """The message: `scan: reason; remedy`."""
        subject = f"{self.mesh}: " if self.mesh else ""
        return f"{subject}{self.reason}" + (f"; {self.remedy}" if self.remedy else "")


class EmptyFile(PipelineError):
    code = "empty_file"
    default_remedy = "export the mesh again and check that the file is not zero bytes"


class UnknownFormat(PipelineError):
    code = "unknown_format"
    default_remedy = (
        "send STL, PLY, OBJ, OFF, 3MF, GLB, AMF, VTP or STEP; "
        "a scan may also be points as PLY, XYZ, LAS, LAZ or E57"
    )


class TruncatedFile(PipelineError):
    code = "truncated_file"
    default_remedy = "the upload or the export is incomplete: export the file and send it again"


class UnreadableFile(PipelineError):
    code = "unreadable_file"
    default_remedy = "open the file in the program that created it, and export it again"


class MeshTooLarge(PipelineError):
    code = "mesh_too_large"
    default_remedy = (
        "decimate the mesh or thin out the points, or raise load.max_faces or load.max_points in the settings"
    )


class NotFinite(PipelineError):
    code = "not_finite"
    default_remedy = "remove the NaN or infinite vertices in the program that created the file"


class CoordinateOutOfRange(PipelineError):
    code = "coordinate_out_of_range"
    default_remedy = (
        "remove the distant vertices in the program that created the file, "
        "or set the unit of the file (options.units)"
    )


class IndexOutOfRange(PipelineError):
    code = "index_out_of_range"
    default_remedy = "the file is damaged or was written incorrectly: export it again"


class NoSurface(PipelineError):
    code = "no_surface"
    default_remedy = "a design needs triangles: export it as a mesh, not as a point cloud"


class PartNotFound(PipelineError):
    code = "part_not_found"
    default_remedy = "send the name or the number of one of them in options.design_part, or all"


class ColumnsUnfit(PipelineError):
    code = "columns_unfit"
    default_remedy = (
        "state the columns of the file in options.columns, such as id,x,y,z, or leave the option out"
    )


class UnitUnknown(PipelineError):
    code = "unit_unknown"
    default_remedy = "set the unit of the file in options.units: mm, cm, m or inch"


class DegenerateMesh(PipelineError):
    stage = Stage.CLEAN
    code = "degenerate_mesh"
    default_remedy = (
        "check the export: the surface of the part must have an extent in more than one direction"
    )


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
    default_remedy = (
        "the surface has too little relief for a landmark study: "
        "lower landmarks.min_relief, or send another part"
    )


class UnknownRegion(PipelineError):
    stage = Stage.INSPECTION
    code = "unknown_region"
    default_remedy = "name segments, triangles or faces that the design has in options.acceptance.regions"


class PointOffSurface(PipelineError):
    stage = Stage.INSPECTION
    code = "point_off_surface"
    default_remedy = "give its position in the frame and unit (mm) of the design, or a larger radius_mm"
