"""The base of every section of the settings, and the words that settings share."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

Unit = Literal["auto", "mm", "cm", "m", "inch"]
SegmentationMethod = Literal["cfsfdp", "kmeans", "fuzzy_cmeans", "kmedians", "kcenters", "gaussian_mixture"]
Detector = Literal["t2", "gaussian_curvature", "agd", "hks", "iss", "gp", "farthest", "random"]
StudyKind = Literal["informativeness", "repeatability"]


class Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
