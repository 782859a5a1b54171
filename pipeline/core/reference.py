"""Which part was measured, as the client's systems know it: carried through to results, report and search."""

from datetime import datetime
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, field_validator

Text = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f]+$")]
Key = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_.-]{0,49}$")]
Value = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x08\x0b-\x1f]*$")]


class Reference(BaseModel):
    """Identity of the part and of the measurement. Nothing of it changes a result."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    part_number: Text | None = Field(None, description="number of the part, or of its drawing")
    serial: Text | None = Field(None, description="serial number of this piece")
    batch: Text | None = Field(None, description="batch or lot")
    order: Text | None = Field(None, description="production order")
    machine: Text | None = Field(None, description="machine that made it")
    operator: Text | None = Field(None, description="who measured it")
    gauge: Text | None = Field(None, description="scanner that measured it")
    measured_at: str | None = Field(
        None, max_length=40, description="when it was measured: ISO 8601, with seconds"
    )
    more: dict[Key, Value] = Field(
        {}, max_length=20, description="further keys of the client: letters, digits, `_`, `.`, `-`"
    )

    @field_validator("measured_at")
    @classmethod
    def _is_a_time(cls, text: str | None) -> str | None:
        if text is not None:
            try:
                datetime.fromisoformat(text)
            except ValueError:
                raise ValueError(f"{text!r} is no time by ISO 8601, such as 2026-11-27T14:16:01") from None
            if "T" not in text:
                raise ValueError(f"{text!r} has no time of the day, such as 2026-11-27T14:16:01")
        return text
