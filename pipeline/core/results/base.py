"""The base of every result record: frozen, every field always present, never NaN or Infinity."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Matrix4 = Annotated[
    list[Annotated[list[float], Field(min_length=4, max_length=4)]], Field(min_length=4, max_length=4)
]


class Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Note(Record):
    """A warning: `code` for machines, `detail` for people."""

    code: str = Field(description="stable code")
    detail: str = Field(description="the same for people, with figures")
