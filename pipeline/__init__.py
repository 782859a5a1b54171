"""The door: everything a caller of the method needs, and nothing else.

    from pipeline import Settings, register
    result = register("design.stl", "scan.stl", out="out")
    print(result.verdict.status, result.metrics.rmse_mm)

Importing this is cheap: open3d, pymeshlab and trimesh are loaded by the first call that computes.
"""

from pipeline.door import MeshFile, find_segments, preload, register
from pipeline.errors import PipelineError
from pipeline.formats import HEAD_BYTES, Format, detect_format
from pipeline.outcome import RegistrationResult, SegmentsResult
from pipeline.progress import OnProgress, Progress, Stage
from pipeline.settings import Settings, Unit

__all__ = [
    "HEAD_BYTES",
    "Format",
    "MeshFile",
    "OnProgress",
    "PipelineError",
    "Progress",
    "RegistrationResult",
    "SegmentsResult",
    "Settings",
    "Stage",
    "Unit",
    "detect_format",
    "find_segments",
    "preload",
    "register",
]
