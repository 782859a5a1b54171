"""The result records: JSON-ready, every field always present, unknown is null (never NaN or Infinity).

`RegistrationResult.model_dump_json()` is `results.json`. The schema is versioned; see
`docs/results-and-verdicts.md` for every field. The transform is always `T_design_scan`: p_design_mm =
T_design_scan @ p_scan_mm.
"""

from pipeline.core.results.alignment import (
    AlignedPoint,
    AlignmentKind,
    AppliedAlignment,
    FreeAlignmentMotion,
)
from pipeline.core.results.base import Note, Record
from pipeline.core.results.deviation import (
    DesignDeviation,
    DesignSide,
    Deviation,
    Distances,
    SegmentDeviation,
    Spread,
)
from pipeline.core.results.inspection import Check, Decision, Extreme, Inspection
from pipeline.core.results.jobs import LandmarksResult, RegistrationResult, SegmentsResult, StudyResult
from pipeline.core.results.mesh import (
    Centre,
    Landmark,
    Landmarks,
    LandmarksOfMesh,
    Match,
    Segments,
    SegmentsOfMesh,
    SegmentsPair,
)
from pipeline.core.results.pose import (
    Alternative,
    FreeMotion,
    Metrics,
    Observability,
    Scale,
    ScaleFactor,
    ScanQuality,
    Symmetry,
    SymmetryAxis,
    Transform,
)
from pipeline.core.results.provenance import Input, Inputs, MadeBy, OneInput, OneProvenance, Provenance
from pipeline.core.results.study import (
    InformativenessProtocol,
    InformativenessRow,
    Quantiles,
    RepeatabilityProtocol,
    RepeatabilityRow,
)
from pipeline.core.results.verdict import Evidence, Finding, Verdict, VerdictStatus

__all__ = [
    "AlignedPoint",
    "AlignmentKind",
    "Alternative",
    "AppliedAlignment",
    "Centre",
    "Check",
    "Decision",
    "DesignDeviation",
    "DesignSide",
    "Deviation",
    "Distances",
    "Evidence",
    "Extreme",
    "Finding",
    "FreeAlignmentMotion",
    "FreeMotion",
    "InformativenessProtocol",
    "InformativenessRow",
    "Input",
    "Inputs",
    "Inspection",
    "Landmark",
    "Landmarks",
    "LandmarksOfMesh",
    "LandmarksResult",
    "MadeBy",
    "Match",
    "Metrics",
    "Note",
    "Observability",
    "OneInput",
    "OneProvenance",
    "Provenance",
    "Quantiles",
    "Record",
    "RegistrationResult",
    "RepeatabilityProtocol",
    "RepeatabilityRow",
    "Scale",
    "ScaleFactor",
    "ScanQuality",
    "SegmentDeviation",
    "Segments",
    "SegmentsOfMesh",
    "SegmentsPair",
    "SegmentsResult",
    "Spread",
    "StudyResult",
    "Symmetry",
    "SymmetryAxis",
    "Transform",
    "Verdict",
    "VerdictStatus",
]
