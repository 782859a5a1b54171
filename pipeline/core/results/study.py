"""Protocols and rows of the studies."""

from typing import Literal

from pydantic import Field

from pipeline.core.results.base import Record
from pipeline.core.settings import Detector


class Quantiles(Record):
    """A distribution over trials."""

    n: int = Field(description="trials that gave a value")
    p05: float | None = Field(description="5 % of the trials are below; null: no trial gave a value")
    p25: float | None = Field(description="25 % of the trials are below; null: no trial gave a value")
    p50: float | None = Field(description="50 % of the trials are below; null: no trial gave a value")
    p75: float | None = Field(description="75 % of the trials are below; null: no trial gave a value")
    p95: float | None = Field(description="95 % of the trials are below; null: no trial gave a value")


class InformativenessProtocol(Record):
    """The paper's five steps on a shape of n points and its own copy: see
    `pipeline/studies/informativeness.py`.
    """

    kind: Literal["informativeness"] = Field("informativeness", description="the paper's protocol")
    trials: int = Field(description="for each detector")
    noise_mm: float = Field(description="the copy is moved by up to this along each axis")
    rotation_deg: float = Field(description="and turned by up to this")
    points: int = Field(description="points of the complete shape")
    count: int = Field(description="points for each detector")
    icp: dict[str, str] = Field(description="the ICP protocols, by name")
    tie: float = Field(
        description="RMSE_c and RMSE_p below this share of the diagonal are both rounding error: a tie"
    )


class InformativenessRow(Record):
    """One detector under one ICP protocol; K = RMSE_c / RMSE_p over the vertices with their known
    partners.
    """

    detector: Detector = Field(description="the landmark detector")
    icp: str = Field(description="name of the ICP protocol")
    points: int = Field(description="points it gave")
    share_above: float = Field(description="share of the trials with K > 1 + 1e-6, ties left out")
    share_tie: float = Field(description="share of the trials where both errors are rounding error")
    share_at_least_10: float = Field(description="share of the trials with K >= 10, ties left out")
    share_raw_above: float = Field(
        description="share of the trials with K > 1 whatever the size of both, as the paper counts"
    )
    k: Quantiles = Field(description="RMSE_c / RMSE_p, ties left out")
    rmse_complete_mm: Quantiles = Field(description="RMSE_c")
    rmse_landmarks_mm: Quantiles = Field(description="RMSE_p")


class RepeatabilityProtocol(Record):
    kind: Literal["repeatability"] = Field(
        "repeatability", description="whether landmarks are found again on another mesh of the shape"
    )
    trials: int = Field(description="for each condition")
    eps: float = Field(description="as a share of the diagonal")
    eps_mm: float = Field(description="the same in mm: found again means within it")
    count: int = Field(description="points for each detector, on either mesh")
    spacing_mm: float = Field(description="smallest distance between two points of a detector, > 2 eps")
    conditions: list[str] = Field(description="how the other meshes were made")


class RepeatabilityRow(Record):
    """One detector under one condition, over all its trials."""

    detector: Detector = Field(description="the landmark detector")
    condition: str = Field(description="one of `conditions`")
    repeatability: Quantiles = Field(
        description="points found again within eps, one to one, over `count` visible points"
    )
    mean: float = Field(description="of the repeatability")
    chance: float = Field(description="the same for as many random points")
    points: float = Field(description="mean number of points on a mesh; missing ones count as not found")
    pose_error_mm: Quantiles = Field(
        description="RMS displacement of the true scan under the pose found from this detector's points alone"
    )
    pose_right: float = Field(description="share of trials with a pose within 1 % of the diagonal")
