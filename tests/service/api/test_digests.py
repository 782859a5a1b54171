"""What was sent is what arrived, both ways (RFC 9530)."""

import base64
import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from service.api.digests import check, content_digest
from service.contract.errors import DigestMismatch
from tests.support.service import TRIANGLE_OBJ, Service

RIGHT = content_digest(hashlib.sha256(TRIANGLE_OBJ).hexdigest())


def put(service: Service, digest: str) -> tuple[int, str | None]:
    answer = service.http.put(
        "/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"}, headers={"Content-Digest": digest}
    )
    return answer.status_code, answer.json().get("code")


def test_the_example_of_the_standard() -> None:
    """RFC 9530, appendix D: the digest of the content {"hello": "world"} and a line feed."""
    content = b'{"hello": "world"}\n'
    assert (
        content_digest(hashlib.sha256(content).hexdigest())
        == "sha-256=:RK/0qy18MlBSVnWgjwz6lZEWjP/lF5HF9bvEF8FabDg=:"
    )


@pytest.mark.parametrize(
    "digest", [RIGHT, f"sha-512=:AAAA:, {RIGHT}", "sha-512=:AAAA:", RIGHT.replace("sha", "SHA")]
)
def test_a_right_digest_is_taken_and_an_unknown_algorithm_left_alone(service: Service, digest: str) -> None:
    assert put(service, digest) == (200, None)


def test_content_that_is_not_what_was_announced_is_thrown_away(service: Service) -> None:
    wrong = content_digest(hashlib.sha256(b"other").hexdigest())
    assert put(service, wrong) == (422, "digest_mismatch")
    assert put(service, "sha-256=:not base64:") == (400, "bad_request")
    blob = "sha256:" + hashlib.sha256(TRIANGLE_OBJ).hexdigest()
    assert service.http.head(f"/v1/blobs/{blob}").status_code == 404
    assert not any(path.is_file() for path in service.settings.blob_dir.rglob("*"))


def test_a_download_carries_the_digest_of_its_bytes(service: Service) -> None:
    job_id = service.finished()
    for name in ("results.json", "aligned.ply"):
        answer = service.http.get(f"/v1/jobs/{job_id}/files/{name}")
        assert answer.headers["Content-Digest"] == content_digest(hashlib.sha256(answer.content).hexdigest())


@given(st.binary(max_size=64), st.binary(max_size=64))
def test_only_the_same_content_passes(sent: bytes, came: bytes) -> None:
    header = f"sha-256=:{base64.b64encode(hashlib.sha256(sent).digest()).decode()}:"
    if sent == came:
        check(header, hashlib.sha256(came).hexdigest())
    else:
        with pytest.raises(DigestMismatch):
            check(header, hashlib.sha256(came).hexdigest())
