"""gzip bodies: what is unpacked is what was meant, and a bomb is cut off early."""

import gzip
import hashlib
import zlib
from collections.abc import Iterator
from functools import cache

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from service.api.digests import content_digest
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem

GZIP = {"Content-Encoding": "gzip"}
NAMED = {"filename": "a.obj"}
BLOB = "sha256:" + hashlib.sha256(TRIANGLE_OBJ).hexdigest()


def pieces(content: bytes, size: int) -> Iterator[bytes]:
    for start in range(0, len(content), size):
        yield content[start : start + size]


@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_a_packed_mesh_is_the_mesh_in_whatever_pieces_it_comes(service: Service, size: int) -> None:
    content = pieces(gzip.compress(TRIANGLE_OBJ), size)
    answer = service.http.put("/v1/blobs", content=content, params=NAMED, headers=GZIP)
    assert (answer.status_code, answer.json()["id"]) == (200, BLOB)


@given(parts=st.lists(st.binary(max_size=2000), min_size=1, max_size=4), size=st.integers(1, 500))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=30)
def test_files_put_one_after_the_other_are_one(service: Service, parts: list[bytes], size: int) -> None:
    plain = TRIANGLE_OBJ + b"".join(b"# " + part.hex().encode() + b"\n" for part in parts)
    cut = len(plain) // 2
    packed = gzip.compress(plain[:cut]) + gzip.compress(plain[cut:])
    answer = service.http.put("/v1/blobs", content=pieces(packed, size), params=NAMED, headers=GZIP)
    assert answer.json()["id"] == "sha256:" + hashlib.sha256(plain).hexdigest()


def test_a_job_may_be_packed_as_a_whole(service: Service) -> None:
    service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params=NAMED)
    body = f'{{"design": {{"blob": "{BLOB}"}}, "scan": {{"blob": "{BLOB}"}}}}'.encode()
    headers = {**GZIP, "Content-Type": "application/json"}
    assert service.http.post("/v1/jobs", content=gzip.compress(body), headers=headers).status_code == 202


@cache
def bomb() -> bytes:
    """A gigabyte of zeros in a megabyte of gzip. After a full flush the same input gives the same bytes, so
    that it is packed once.
    """
    packer, block = zlib.compressobj(9, zlib.DEFLATED, 31), bytes(2**20)
    first, again = (packer.compress(block) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
    packed = first + 999 * again
    opener = zlib.decompressobj(31)
    assert opener.decompress(packed, 2**22) == bytes(2**22) and not opener.eof
    return packed


@pytest.mark.parametrize("kind", ["application/octet-stream", "application/json"])
def test_a_bomb_is_cut_off(service: Service, kind: str) -> None:
    """On a service that takes a megabyte."""
    assert len(bomb()) < 2**20
    method, path = ("PUT", "/v1/blobs") if kind == "application/octet-stream" else ("POST", "/v1/jobs")
    answer = service.http.request(method, path, content=bomb(), headers={**GZIP, "Content-Type": kind})
    assert_problem(answer, 413, "payload_too_large")
    assert not any(path.is_file() for path in service.settings.blob_dir.rglob("*"))
    assert service.submit().status_code == 202


@pytest.mark.parametrize(
    "content",
    [gzip.compress(TRIANGLE_OBJ)[:-5], b"not gzip at all", gzip.compress(TRIANGLE_OBJ) + b"rest", b""],
    ids=["cut", "plain", "rest", "empty"],
)
def test_what_is_no_whole_gzip_is_refused(service: Service, content: bytes) -> None:
    answer = service.http.put("/v1/blobs", content=content, params=NAMED, headers=GZIP)
    assert_problem(answer, 400, "bad_request", "gzip")
    assert service.http.head(f"/v1/blobs/{BLOB}").status_code == 404


def test_other_encodings_are_refused_by_name(service: Service) -> None:
    answer = service.http.put("/v1/blobs", content=b"x", headers={"Content-Encoding": "br"})
    assert_problem(answer, 415, "unsupported_media_type", "'br'")


def test_the_digest_is_of_the_packed_bytes(service: Service) -> None:
    packed = gzip.compress(TRIANGLE_OBJ)
    right, wrong = (content_digest(hashlib.sha256(each).hexdigest()) for each in (packed, TRIANGLE_OBJ))
    for digest, status in ((right, 200), (wrong, 422)):
        headers = {**GZIP, "Content-Digest": digest}
        assert (
            service.http.put("/v1/blobs", content=packed, params=NAMED, headers=headers).status_code == status
        )
