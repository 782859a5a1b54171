"""All sections together, and the presets."""

from typing import Literal, Self

from pydantic import model_validator

from pipeline.core.settings.analysis import (
    CleanSettings,
    FeaturesSettings,
    GeodesicsSettings,
    LandmarksSettings,
    LoadSettings,
    ResampleSettings,
    SegmentationSettings,
)
from pipeline.core.settings.base import Section
from pipeline.core.settings.jobs import ReportSettings, StudySettings
from pipeline.core.settings.pose import DeviationSettings, MatchingSettings, RegistrationSettings


class Settings(Section):
    """All sections; unknown keys are an error."""

    load: LoadSettings = LoadSettings()
    clean: CleanSettings = CleanSettings()
    resample: ResampleSettings = ResampleSettings()
    geodesics: GeodesicsSettings = GeodesicsSettings()
    segmentation: SegmentationSettings = SegmentationSettings()
    features: FeaturesSettings = FeaturesSettings()
    landmarks: LandmarksSettings = LandmarksSettings()
    matching: MatchingSettings = MatchingSettings()
    registration: RegistrationSettings = RegistrationSettings()
    deviation: DeviationSettings = DeviationSettings()
    study: StudySettings = StudySettings()
    report: ReportSettings = ReportSettings()

    @model_validator(mode="after")
    def _enough_centres(self) -> Self:
        wanted = self.segmentation.n_centres
        if wanted is not None and wanted > self.segmentation.max_centres:
            raise ValueError("segmentation.n_centres is above segmentation.max_centres")
        return self

    @classmethod
    def paper(cls) -> "Settings":
        """The paper: the file's own vertices, counted; integrated features; covariance PCA; the printed
        limit.
        """
        return cls(
            resample=ResampleSettings(enabled=False),
            geodesics=GeodesicsSettings(metric="surface"),
            segmentation=SegmentationSettings(
                quantile=0.02, density="vertex", kernel="cutoff", centre_rule="decision_graph"
            ),
            features=FeaturesSettings(kind="integrated"),
            landmarks=LandmarksSettings(
                confidence=0.97,
                statistics="segment",
                standardize=False,
                include_halo=False,
                border_distance_radii=0,
                spacing_radii=0,
                min_relief=0,
                localize_radii=0,
            ),
            study=StudySettings(noise_mm=2.5),
        )

    @classmethod
    def preset(cls, name: Literal["default", "paper"]) -> "Settings":
        return cls.paper() if name == "paper" else cls()
