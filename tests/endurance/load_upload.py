"""Load of one large upload: its seconds, and the memory it takes of the API process."""

import http.client
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import psutil

from tests.support.running import RunningService

MIB = 1024 * 1024


class Watch:
    """The most resident memory of a process while inside, looked at every 10 ms."""

    def __init__(self, process: psutil.Process) -> None:
        self._process, self._stop = process, threading.Event()
        self.before = process.memory_info().rss / MIB
        self.peak = self.before
        self._thread = threading.Thread(target=self._look)

    def _look(self) -> None:
        while not self._stop.wait(0.01):
            self.peak = max(self.peak, self._process.memory_info().rss / MIB)

    def __enter__(self) -> "Watch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()


def big_stl(path: Path, mib: int) -> int:
    """A binary STL of this size; nobody will parse it."""
    count = (mib * MIB - 84) // 50
    block = np.random.default_rng(0).bytes(50 * 20_000)
    with path.open("wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", count))
        for _ in range(count // 20_000):
            file.write(block)
        file.write(block[: 50 * (count % 20_000)])
    return path.stat().st_size


def upload(service: RunningService, folder: Path, mib: int) -> dict[str, str]:
    """The same file as a raw body, and in a form."""
    path = folder / "big.stl"
    size = big_stl(path, mib)
    api = service.part("api")
    with Watch(api) as raw, path.open("rb") as body:
        begun = time.perf_counter()
        connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=300)
        connection.request("PUT", "/v1/blobs", body=body, headers={"Content-Length": str(size)})
        answer = connection.getresponse()
        assert answer.status == 200, answer.read()
        answer.read()
        connection.close()
        raw_s = time.perf_counter() - begun
    boundary = "cusp-boundary"
    head = f'--{boundary}\r\nContent-Disposition: form-data; name="mesh"; filename="big.stl"\r\n\r\n'.encode()
    kind = (
        f'\r\n--{boundary}\r\nContent-Disposition: form-data; name="type"\r\n\r\n'
        f"landmarks\r\n--{boundary}--\r\n"
    ).encode()

    def form() -> Iterator[bytes]:
        yield head
        with path.open("rb") as body:
            while chunk := body.read(MIB):
                yield chunk
        yield kind

    with Watch(api) as multipart:
        begun = time.perf_counter()
        sent = httpx.post(
            f"http://127.0.0.1:{service.port}/v1/jobs",
            content=form(),
            headers={
                "Content-Type": f"multipart/form-data; boundary={boundary}",
                "Content-Length": str(len(head) + size + len(kind)),
            },
            timeout=300,
        )
        form_s = time.perf_counter() - begun
    assert sent.status_code == 202, sent.text
    service.client.dismiss(sent.json()["id"])
    return {
        f"{mib} MiB by PUT": (
            f"{raw_s:.1f} s; API resident {raw.before:.0f} MiB before, at most {raw.peak:.0f}"
        ),
        f"{mib} MiB in a form": f"{form_s:.1f} s; at most {multipart.peak:.0f} MiB",
    }
