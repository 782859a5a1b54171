"""The public API: everything a caller of the method needs, and nothing else.

    from pipeline import Settings, register
    result = register("design.stl", "scan.stl", out="out")
    print(result.verdict.status, result.metrics.rmse_mm)

Importing this is cheap: open3d, pymeshlab and trimesh are loaded by the first call that computes.
"""

from pipeline.api import find_landmarks, find_segments, preload, register, study
from pipeline.core import errors
from pipeline.core.acceptance import Acceptance, BrepFacesRegion
from pipeline.core.alignment import (
    Alignment,
    BestFit,
    ConstrainedFit,
    LandmarksFit,
    RpsFit,
    ToleranceFit,
    limits_are_given,
    parse_alignment,
)
from pipeline.core.characteristics import Characteristics, with_named_regions
from pipeline.core.code_fingerprint import code_fingerprint
from pipeline.core.errors import PipelineError
from pipeline.core.formats import HEAD_BYTES, Format, detect_format
from pipeline.core.mesh_file import MeshFile
from pipeline.core.point_columns import PointColumns
from pipeline.core.progress import OnProgress, Progress, Stage
from pipeline.core.reference import Reference
from pipeline.core.report_header import ReportHeader
from pipeline.core.results import (
    Decision,
    LandmarksResult,
    RegistrationResult,
    SegmentsResult,
    StudyResult,
    VerdictStatus,
)
from pipeline.core.settings import Detector, Settings, StudyKind, StudySettings, Unit

__all__ = [
    "HEAD_BYTES",
    "Acceptance",
    "Alignment",
    "BestFit",
    "BrepFacesRegion",
    "Characteristics",
    "ConstrainedFit",
    "Decision",
    "Detector",
    "Format",
    "LandmarksFit",
    "LandmarksResult",
    "MeshFile",
    "OnProgress",
    "PipelineError",
    "PointColumns",
    "Progress",
    "Reference",
    "RegistrationResult",
    "ReportHeader",
    "RpsFit",
    "SegmentsResult",
    "Settings",
    "Stage",
    "StudyKind",
    "StudyResult",
    "StudySettings",
    "ToleranceFit",
    "Unit",
    "VerdictStatus",
    "code_fingerprint",
    "detect_format",
    "errors",
    "find_landmarks",
    "find_segments",
    "limits_are_given",
    "parse_alignment",
    "preload",
    "register",
    "study",
    "with_named_regions",
]
