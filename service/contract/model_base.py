"""What every model of the contract is built from."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

BLOB_ID, SHA256 = r"^sha256:[0-9a-f]{64}$", r"^[0-9a-f]{64}$"
BlobId = Annotated[str, Field(pattern=BLOB_ID, description="`sha256:` and 64 hex digits")]
_UUID = r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}"
#: Where a list goes on: ids of jobs, of messages. Another text would be compared with them as a word.
CURSOR, MESSAGE_CURSOR = f"^{_UUID}$", f"^msg_{_UUID}$"
NO_NUL = r"^[^\x00]*$"  # PostgreSQL has no text with it
VISIBLE_ASCII = r"^[\x21-\x7e]+$"


class Request(BaseModel):
    """Base of what clients send: an unknown key is an error, so that a typo is never silently ignored."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Response(BaseModel):
    """Base of what clients get: every field always present, unknown is null."""

    model_config = ConfigDict(allow_inf_nan=False)
