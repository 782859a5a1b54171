"""Errors as RFC 9457 problems."""

from pydantic import BaseModel, ConfigDict, Field

from service.contract.model_base import Response


class ProblemItem(Response):
    """One wrong value of a request."""

    pointer: str = Field(description="JSON Pointer (RFC 6901) to the wrong value in the request")
    detail: str = Field(description="what is wrong with it")


class Problem(BaseModel):
    """An error as RFC 9457 `application/problem+json`; there, members without a value are left out."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="URN of the kind of problem; stable like `code`")
    title: str = Field(description="the kind of problem in a few words; the same for each `code`")
    status: int = Field(description="HTTP status")
    detail: str = Field(description="this case: which input, what is wrong, what to do")
    code: str = Field(description="stable identifier of the kind of problem")
    mesh: str | None = Field(None, description="the input it is about: `design`, `scan` or `mesh`")
    stage: str | None = Field(None, description="the stage of the method that failed")
    errors: list[ProblemItem] | None = Field(None, description="each wrong value of the request")
    instance: str | None = Field(
        None, description="id of this occurrence; quote it to the operator of the service"
    )
