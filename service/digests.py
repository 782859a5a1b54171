"""`Content-Digest` (RFC 9530): what was sent is what arrived, both ways. Of the algorithms sha-256 is looked at."""

import base64
import binascii
import re

from service.errors import BadRequest, DigestMismatch

_SHA256 = re.compile(r"(?:^|,)\s*sha-256\s*=\s*:([^:]*):", re.IGNORECASE)


def content_digest(sha256: str) -> str:
    """The header's value. sha256 : hex"""
    return f"sha-256=:{base64.b64encode(bytes.fromhex(sha256)).decode()}:"


def check(header: str | None, sha256: str) -> None:
    """Hold what the client announced, if it did, against what came.

    Raises
    ------
    BadRequest, DigestMismatch
    """
    found = _SHA256.search(header or "")
    if found is None:
        return
    try:
        announced = base64.b64decode(found[1], validate=True)
    except binascii.Error as error:
        raise BadRequest("Content-Digest: sha-256 is not base64 between colons (RFC 9530)") from error
    if announced.hex() != sha256:
        raise DigestMismatch(
            f"Content-Digest says sha-256 {announced.hex()[:16]}..., what came has {sha256[:16]}...; send it again"
        )
