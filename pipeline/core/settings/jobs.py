"""Settings of what a job makes: studies and the report."""

from typing import Literal, Self

from pydantic import Field, model_validator

from pipeline.core.settings.base import Detector, Section, StudyKind


class StudySettings(Section):
    """What a study job does; `options.study` of a job overrides it."""

    kind: StudyKind = Field(
        "informativeness",
        description="the paper's protocol, or whether landmarks are found again on another mesh of the shape",
    )
    trials: int | None = Field(
        None,
        ge=1,
        le=1_000_000,
        description="null: 10,000 for informativeness, 5 a condition for repeatability",
    )
    detectors: tuple[Detector, ...] = Field(
        ("t2", "gaussian_curvature", "agd", "hks", "iss", "gp", "farthest", "random"),
        min_length=1,
        description="landmark detectors compared, with the same number of points each",
    )
    noise_mm: float | None = Field(
        None,
        gt=0,
        description="informativeness: each coordinate moves by up to this (paper: 2.5); null: 3 % of the "
        "diagonal. "
        "repeatability: standard deviation of the noise; null: 0.1 % and 0.3 % of the diagonal",
    )
    rotation_deg: float = Field(
        0.0,
        ge=0,
        le=180,
        description="informativeness: also turn by up to this about a random axis (paper: 0)",
    )
    eps: float = Field(
        0.01, gt=0, lt=0.2, description="repeatability: found again means within this share of the diagonal"
    )
    count: int | None = Field(
        None,
        ge=3,
        le=10_000,
        description="points a detector; null: as many as t2 gives for informativeness, 20 for repeatability",
    )


class ReportSettings(Section):
    write_files: bool = Field(True, description="false: as `content` none")
    content: Literal["full", "light", "none"] = Field(
        "full",
        description="files beside results.json. full: all; light: those that programs read (landmarks.csv, "
        "aligned.ply, deviation.ply; mesh.segments.ply of one mesh), no pictures and no page; none",
    )
    language: Literal["en", "de"] = Field(
        "en", description="of report.html, report.pdf and the histogram: English or German"
    )
    summary: bool = Field(
        False,
        description="registration: report.html and report.pdf hold the first page only: identity, decision, "
        "verdict, key figures, checks, views and histogram",
    )
    pdf: bool = Field(False, description="also write report.pdf: the page of report.html on A4")
    three_mf: bool = Field(
        False,
        description="registration: also write aligned.3mf, the aligned scan in the colours of its "
        "deviation, its unit declared "
        "(experimental)",
    )

    qdas: bool = Field(
        False,
        description="registration: also write characteristics.dfq, the checks of the inspection in the "
        "Q-DAS ASCII transfer format (AQDEF)",
    )

    @model_validator(mode="after")
    def _files_to_write(self) -> Self:
        if not self.writes_files and (self.pdf or self.three_mf or self.qdas):
            raise ValueError(
                "report.pdf, report.three_mf and report.qdas are files: they need report.write_files, and "
                "report.content other than none"
            )
        if self.content == "light" and self.pdf:
            raise ValueError("report.pdf is the page of report.html: it needs report.content full")
        return self

    @property
    def writes_files(self) -> bool:
        """Whether there are files beside results.json."""
        return self.write_files and self.content != "none"

    @property
    def is_full(self) -> bool:
        """Whether there are files for people too."""
        return self.write_files and self.content == "full"
