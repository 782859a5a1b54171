"""What every model of the contract is built from."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

BlobId = Annotated[str, Field(pattern=r"^sha256:[0-9a-f]{64}$", description="`sha256:` and 64 hex digits")]
NO_NUL = r"^[^\x00]*$"  # PostgreSQL has no text with it


class Request(BaseModel):
    """Base of what clients send: an unknown key is an error, so that a typo is never silently ignored."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Response(BaseModel):
    """Base of what clients get: every field always present, unknown is null."""

    model_config = ConfigDict(allow_inf_nan=False)
