"""Outages on purpose: an S3 server that answers 503, a disk that is full, a clock that is wrong."""

import os
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import urlsplit

REFUSAL = b"HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"
PIECE = 64 * 1024


class Switch:
    """A way to a server that can be closed: then every request is answered 503. endpoint : of the server"""

    def __init__(self, endpoint: str) -> None:
        address = urlsplit(endpoint)
        assert address.hostname is not None and address.port is not None, endpoint
        self._server = (address.hostname, address.port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.endpoint = f"http://127.0.0.1:{self._listener.getsockname()[1]}"
        self._open: set[socket.socket] = set()
        self.is_closed = False
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self) -> None:
        """Answer 503 from now on, and cut what is under way."""
        self.is_closed = True
        for each in list(self._open):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)

    def reopen(self) -> None:
        """Pass requests on again."""
        self.is_closed = False

    def stop(self) -> None:
        """Listen no longer."""
        self.close()
        with suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        with client, suppress(OSError):
            if self.is_closed:
                client.recv(PIECE)
                client.sendall(REFUSAL)
                return
            with socket.create_connection(self._server) as server:
                pair = {client, server}
                self._open |= pair
                back = threading.Thread(target=_pass_on, args=(server, client), daemon=True)
                back.start()
                _pass_on(client, server)
                back.join()
                self._open -= pair


def _pass_on(source: socket.socket, target: socket.socket) -> None:
    with suppress(OSError):
        while piece := source.recv(PIECE):
            target.sendall(piece)
    with suppress(OSError):
        target.shutdown(socket.SHUT_WR)


@contextmanager
def full_disk(folder: Path) -> Iterator[None]:
    """No byte is free where `folder` is, until the end of the block. For a small file system of its own."""
    filler = folder / "filler"
    try:
        with filler.open("wb", buffering=0) as file, suppress(OSError):
            while True:
                file.write(b"\0" * 2**20 if os.statvfs(folder).f_bavail > 512 else b"\0" * 4096)
        yield
    finally:
        filler.unlink(missing_ok=True)


def clock_ahead(seconds: int, folder: Path) -> dict[str, str]:
    """The environment of a process whose wall clock is wrong. folder : for the library that it loads"""
    library = folder / "clock_ahead.so"
    source = Path(__file__).with_name("clock_ahead.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-O2", "-o", library, source, "-ldl"], check=True)
    return {"LD_PRELOAD": str(library), "CLOCK_AHEAD_S": str(seconds)}
