"""A mesh is fetched from the address that a client gave: guarded, with a deadline and a limit of its size.

Each name is resolved once and the connection goes to the address that was checked, so DNS rebinding has no
effect; the address of each redirect is checked in the same way.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol
from urllib.parse import urljoin, urlsplit

import httpcore

from service import version
from service.contract.errors import MeshNotFetched, PayloadTooLarge
from service.webhooks.address_guard import ForbiddenAddress, Guard
from service.webhooks.http_client import GuardedBackend, tls_context

READ_TIMEOUT_S = 30.0  # to connect to an address, and for each read
MAX_REDIRECTS = 5
REDIRECTS = (301, 302, 303, 307, 308)
MIB = 1024 * 1024


class Writer(Protocol):
    """Takes the content."""

    def write(self, chunk: bytes) -> None:
        """Append."""


def without_query(url: str) -> str:
    """The address without query and fragment, which may hold a signature."""
    return url.partition("?")[0].partition("#")[0]


@dataclass(frozen=True, slots=True)
class MeshFetcher:
    """Safe to share between threads. Ignores proxies of the environment: they would resolve names."""

    guard: Guard
    max_bytes: int
    time_limit_s: float

    def fetch(self, url: str, into: Writer, is_wanted: Callable[[], bool] = lambda: True) -> None:
        """Write the content of the address to `into`, chunk by chunk.

        Raises
        ------
        MeshNotFetched
            When the address is forbidden, does not answer 200 in time, or `is_wanted` becomes false.
        PayloadTooLarge
        """
        backend = GuardedBackend(self.guard, self.time_limit_s)
        with httpcore.ConnectionPool(
            ssl_context=tls_context(), network_backend=backend, max_keepalive_connections=0
        ) as pool:
            try:
                for _ in range(MAX_REDIRECTS + 1):
                    self.guard.check_url(url)
                    with _get(pool, url) as answer:
                        if answer.status in REDIRECTS:
                            url = _redirected(url, answer)
                            continue
                        return self._read(url, answer, into, is_wanted)
            except ForbiddenAddress as error:
                raise MeshNotFetched(f"{without_query(url)[:300]} {error}") from error
            except (
                *(httpcore.NetworkError, httpcore.TimeoutException, httpcore.ProtocolError),
                *(OSError, ValueError),
            ) as error:
                reason = str(error) or type(error).__name__
                raise MeshNotFetched(f"{without_query(url)[:300]} cannot be read: {reason[:300]}") from error
        raise MeshNotFetched(f"{without_query(url)[:300]}: more than {MAX_REDIRECTS} redirects")

    def _read(self, url: str, answer: httpcore.Response, into: Writer, is_wanted: Callable[[], bool]) -> None:
        where = without_query(url)[:300]
        if answer.status != 200:
            raise MeshNotFetched(f"{where} answers {answer.status}; the address may be wrong or expired")
        if _header(answer, b"content-encoding") not in ("", "identity"):
            raise MeshNotFetched(f"{where} answers with a content encoding that was not asked for")
        size = 0
        for chunk in answer.iter_stream():
            size += len(chunk)
            if size > self.max_bytes:
                raise PayloadTooLarge(f"{where} has more than {self.max_bytes // MIB} MiB")
            if not is_wanted():
                raise MeshNotFetched(f"{where}: the job was cancelled")
            into.write(chunk)


@contextmanager
def _get(pool: httpcore.ConnectionPool, url: str) -> Iterator[httpcore.Response]:
    headers: dict[bytes | str, bytes | str] = {
        "Host": urlsplit(url).netloc,
        "User-Agent": f"cusp/{version.VERSION}",
        "Accept-Encoding": "identity",
        "Accept": "*/*",
    }
    timeout = dict.fromkeys(("connect", "read", "write", "pool"), READ_TIMEOUT_S)
    with pool.stream("GET", url, headers=headers, extensions={"timeout": timeout}) as answer:
        yield answer


def _redirected(url: str, answer: httpcore.Response) -> str:
    target = urljoin(url, _header(answer, b"location"))
    if urlsplit(url).scheme == "https" and urlsplit(target).scheme != "https":
        raise MeshNotFetched(f"{without_query(url)[:300]} redirects to an address without TLS")
    return target


def _header(answer: httpcore.Response, name: bytes) -> str:
    return next((value.decode("latin-1") for key, value in answer.headers if key.lower() == name), "")
