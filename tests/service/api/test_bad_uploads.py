"""What the API can know without parsing, it says at once: which file, what is wrong, what to do."""

import http.client
import io
import json
import struct
import zipfile
from collections.abc import Iterator

import pytest

from tests.support.service import TRIANGLE_OBJ, Service, assert_problem

HEADER = b"binary".ljust(80)
FACE = struct.pack("<12fH", *range(12), 0)


@pytest.mark.parametrize(
    ("name", "content", "status", "code"),
    [
        ("s.stl", b"", 422, "empty_file"),
        ("s.stl", HEADER + struct.pack("<I", 3) + FACE, 422, "truncated_file"),
        ("s.stl", HEADER + struct.pack("<I", 2**32 - 2) + FACE * 10, 422, "truncated_file"),
        ("s.stl", b"\0" * 40, 422, "truncated_file"),
        ("s.txt", b"Dear Sir or Madam,\nplease find attached", 415, "unknown_format"),
        ("s.stl", b"Dear Sir or Madam,\nplease find attached", 415, "unknown_format"),
        ("s.igs", b" " * 72 + b"S      1\n1H,,1H;,4Hpart" + b" " * 53 + b"G      1\n", 415, "unknown_format"),
        ("s.jpg", b"\xff\xd8\xff\xe0" + bytes(range(256)), 415, "unknown_format"),
        ("s.stl", b"<!DOCTYPE html><html><body>Sign in</body></html>", 415, "unknown_format"),
        (
            "s.stl",
            b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n",
            415,
            "unknown_format",
        ),
        ("s.stl", bytes(5000), 422, "unreadable_file"),
    ],
)
@pytest.mark.parametrize("mesh", ["design", "scan"])
def test_a_file_that_cannot_be_a_mesh_is_refused_at_once(
    service: Service, mesh: str, name: str, content: bytes, status: int, code: str
) -> None:
    answer = service.submit(**{mesh: (name, content)})
    assert_problem(answer, status, code, f"{mesh}: ")
    assert answer.json()["mesh"] == mesh
    assert_problem(service.http.put("/v1/blobs", content=content, params={"filename": name}), status, code)
    assert service.submit().status_code == 202  # and the service goes on


def test_what_only_a_parser_can_know_is_left_to_the_child(service: Service) -> None:
    bomb = io.BytesIO()
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", b" " * 10_000_000)
    assert service.submit(scan=("s.3mf", bomb.getvalue())).status_code == 202


def test_too_large_is_refused_before_it_is_read(service: Service) -> None:
    connection = http.client.HTTPConnection(service.http.base_url.host, service.http.base_url.port or 80)
    connection.putrequest("PUT", "/v1/blobs")
    connection.putheader("Content-Length", "100000000")
    connection.endheaders()  # and not one byte of the body
    answer = connection.getresponse()
    problem = json.loads(answer.read())
    assert (answer.status, problem["code"]) == (413, "payload_too_large")
    assert "1 MiB" in problem["detail"]
    connection.close()


def test_too_large_without_a_length_is_refused_while_it_is_read(service: Service) -> None:
    def body() -> Iterator[bytes]:
        for _ in range(3):
            yield b"#" * 500_000

    assert_problem(service.http.put("/v1/blobs", content=body()), 413, "payload_too_large")
    assert not [path for path in service.settings.blob_dir.rglob("*") if path.is_file()]


@pytest.mark.parametrize(
    "filename", ["../../../etc/passwd", "/etc/passwd", "a\0b.obj", "x" * 300 + ".obj", "scan <b>.obj", ""]
)
def test_a_hostile_file_name_is_only_a_hint(service: Service, filename: str) -> None:
    answer = service.submit(scan=(filename, TRIANGLE_OBJ)) if filename else service.submit()
    assert answer.status_code in (202, 422), answer.text
    if answer.status_code == 202:
        service.worker.run(answer.json()["id"])
        assert service.sandbox.tasks[0]["scan"]["path"].endswith("/scan.mesh")


def test_a_broken_form_is_a_bad_request(service: Service) -> None:
    headers = {"content-type": "multipart/form-data; boundary=x"}
    assert_problem(
        service.http.post("/v1/jobs", content=b"--y\r\nnonsense", headers=headers), 400, "bad_request"
    )
    headers = {"content-type": "multipart/form-data"}
    assert_problem(service.http.post("/v1/jobs", content=b"", headers=headers), 400, "bad_request")
