"""The settings of the method: one frozen section for each stage, working defaults, units in the names.

`Settings()` is the default; `Settings.paper()` follows the paper to the letter.
Lengths given as a share refer to the size of the *design*, so that both meshes of a job are analysed at one
scale. Limits of the search and the verdict that users cannot set: `search/schedule.py`,
`verification/thresholds.py`.
"""

from pipeline.core.settings.analysis import (
    CleanSettings,
    FeaturesSettings,
    GeodesicsSettings,
    LandmarksSettings,
    LoadSettings,
    ResampleSettings,
    SegmentationSettings,
)
from pipeline.core.settings.base import Detector, Section, SegmentationMethod, StudyKind, Unit
from pipeline.core.settings.jobs import ReportSettings, StudySettings
from pipeline.core.settings.pose import DeviationSettings, MatchingSettings, RegistrationSettings
from pipeline.core.settings.sections import Settings

__all__ = [
    "CleanSettings",
    "Detector",
    "DeviationSettings",
    "FeaturesSettings",
    "GeodesicsSettings",
    "LandmarksSettings",
    "LoadSettings",
    "MatchingSettings",
    "RegistrationSettings",
    "ReportSettings",
    "ResampleSettings",
    "Section",
    "SegmentationMethod",
    "SegmentationSettings",
    "Settings",
    "StudyKind",
    "StudySettings",
    "Unit",
]
