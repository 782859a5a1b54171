"""Options of a job, as clients send them."""

from typing import Any, Literal

from pydantic import Field, JsonValue, field_serializer, field_validator

from pipeline import Acceptance, Alignment, PointColumns, Reference, StudySettings, Unit
from service.contract.model_base import NO_NUL, Request


class Units(Request):
    """Length unit of each file. For a mesh that the job does not have, only `auto` is allowed."""

    design: Unit = Field(
        "auto", description="`auto`: as the file declares (GLB and E57 are in metres), else mm"
    )
    scan: Unit = Field("auto", description="as for `design`")
    mesh: Unit = Field("auto", description="as for `design`; of a `landmarks` or `study` job")


class Webhook(Request):
    """Receiver of a signed message when the job is final, by Standard Webhooks; repeated until it is
    accepted.
    """

    url: str = Field(
        max_length=2000, description="http(s) address; a private one only if the operator allows its network"
    )


class Options(Request):
    """Options of a job; all have defaults."""

    preset: Literal["default", "paper"] = Field(
        "default", description="the settings that `settings` modifies"
    )
    settings: dict[str, JsonValue] = Field(
        {}, description="any part of the Settings of the pipeline; replaces values of the preset"
    )
    units: Units = Field(Units(), description="unit of each file")
    tolerance_mm: float | None = Field(
        None,
        gt=0,
        description="`registration` only: limit of `deviation.within` and of the pose uncertainty (1 sigma)",
    )
    scan_accuracy_mm: float | None = Field(
        None,
        gt=0,
        description="`registration` only: accuracy of the scanner, one sigma, as its maker states it: how "
        "far a scan of a right part may lie off the design",
    )
    acceptance: Acceptance | None = Field(
        None,
        description="`registration` only: what the part must satisfy; `inspection` in the results says "
        "whether it does. Without limits of its own it takes `tolerance_mm`",
    )
    reference: Reference | None = Field(
        None,
        description="`registration` only: identity of the part; carried through, and searched by "
        "(`GET /v1/jobs?serial=`)",
    )
    alignment: Alignment | None = Field(
        None,
        description="`registration` only: how the scan lies on the design for deviation, inspection and "
        "files; null: as it fits best. The verdict is always about the best fit",
    )
    design_part: str | None = Field(
        None,
        min_length=1,
        max_length=300,
        pattern=NO_NUL,
        description="`registration` only: the part of the design file that was scanned, where it has several "
        "(build items of a 3MF, objects of an OBJ, solids of an STL, meshes of a glTF): name, number from 1, "
        "several numbers (`1,3`), or `all`, the default",
    )
    columns: str | None = Field(
        None,
        min_length=1,
        max_length=2000,
        pattern=NO_NUL,
        description="`registration` only: columns of a scan that is a text of points, where the text can be "
        "read in two ways: the name of each in order (`id,x,y,z`), or the numbers of x, y and z (`2,3,4`); "
        "then, where needed, `decimal=comma` or `decimal=point`, and `delimiter=` `space`, `tab`, `comma`, "
        "`semicolon` or `pipe`",
    )
    study: StudySettings | None = Field(
        None, description="`study` only: what to measure; each key replaces one of `settings.study`"
    )
    seed: int = Field(0, ge=0, lt=2**32, description="seed of every random draw")
    label: str | None = Field(
        None, max_length=200, pattern=NO_NUL, description="free text of the client, to find the job again"
    )
    webhook: Webhook | None = Field(None, description="receiver of a message when the job is final")

    @field_validator("columns")
    @classmethod
    def _columns_known(cls, columns: str | None) -> str | None:
        if columns is not None:
            PointColumns.of(columns)
        return columns

    @field_serializer("study")
    def _study_as_sent(self, study: StudySettings | None) -> dict[str, Any] | None:
        """Only the keys that were sent; the others come from the preset and the settings."""
        return None if study is None else study.model_dump(mode="json", exclude_unset=True)
