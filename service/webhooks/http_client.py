"""One POST to the address of a webhook: guarded, with a deadline; the body of the answer is ignored.

The name is resolved once and the connection goes to the address that was checked, so DNS rebinding has no
effect. Redirects are not followed.
"""

import socket
import ssl
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any
from urllib.parse import urlsplit

import certifi
import httpcore

from service import version
from service.webhooks.address_guard import ForbiddenAddress, Guard
from service.webhooks.outbox import Answer

TIMEOUT_S = 10.0  # to connect to an address, and for each read
TOTAL_S = 40.0  # for the whole request; below `outbox.LEASE_MS`, after which another sender repeats it
MAX_RETRY_AFTER_S = 24 * 3600


@dataclass(frozen=True, slots=True)
class Deadline:
    """The end of a request, also if the receiver still sends single bytes."""

    at: float  # of time.monotonic
    total_s: float = TOTAL_S

    def remaining(self, at_most: float | None) -> float:
        """Remaining seconds. Raises httpcore.ReadTimeout if there are none."""
        seconds = self.at - time.monotonic()
        if seconds <= 0:
            raise httpcore.ReadTimeout(f"no answer within {self.total_s:g} s")
        return seconds if at_most is None else min(seconds, at_most)


class DeadlineStream(httpcore.NetworkStream):
    """A connection that ends at a deadline."""

    def __init__(self, stream: httpcore.NetworkStream, deadline: Deadline) -> None:
        self._stream, self._deadline = stream, deadline

    def read(self, max_bytes: int, timeout: float | None = None) -> bytes:
        """See httpcore."""
        return self._stream.read(max_bytes, self._deadline.remaining(timeout))

    def write(self, buffer: bytes, timeout: float | None = None) -> None:
        """See httpcore."""
        self._stream.write(buffer, self._deadline.remaining(timeout))

    def close(self) -> None:
        """See httpcore."""
        self._stream.close()

    def start_tls(
        self, ssl_context: ssl.SSLContext, server_hostname: str | None = None, timeout: float | None = None
    ) -> httpcore.NetworkStream:
        """See httpcore."""
        secure = self._stream.start_tls(ssl_context, server_hostname, self._deadline.remaining(timeout))
        return DeadlineStream(secure, self._deadline)

    def get_extra_info(self, info: str) -> Any:
        """See httpcore."""
        return self._stream.get_extra_info(info)


class GuardedBackend(httpcore.NetworkBackend):
    """Network backend of httpcore that checks each resolved address.

    Each connection is used once, so its deadline is that of the request.
    """

    def __init__(self, guard: Guard, total_s: float | None = None) -> None:
        """total_s : of a whole request, None for `TOTAL_S`"""
        self._guard, self._total_s = guard, total_s
        self._sockets = httpcore.SyncBackend()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[httpcore.SOCKET_OPTION] | None = None,
    ) -> httpcore.NetworkStream:
        """Resolve the name, check every address, connect to the first that accepts."""
        total_s = TOTAL_S if self._total_s is None else self._total_s
        deadline = Deadline(time.monotonic() + total_s, total_s)
        try:
            resolved = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        except (OSError, UnicodeError) as error:
            raise httpcore.ConnectError(f"{host} has no address ({error})") from error
        addresses = [str(each[4][0]) for each in resolved]
        for address in addresses:
            self._guard.check(host, ip_address(address.partition("%")[0]))
        refused: Exception = httpcore.ConnectError(f"{host} has no address")
        for address in dict.fromkeys(addresses):
            try:
                seconds = deadline.remaining(timeout)
                stream = self._sockets.connect_tcp(address, port, seconds, local_address, socket_options)
                return DeadlineStream(stream, deadline)
            except (httpcore.ConnectError, httpcore.ConnectTimeout) as error:
                refused = error
        raise refused

    def sleep(self, seconds: float) -> None:
        """See httpcore."""
        self._sockets.sleep(seconds)


def tls_context() -> ssl.SSLContext:
    """The authorities of the system and SSL_CERT_FILE, and those of Mozilla."""
    context = ssl.create_default_context()
    context.load_verify_locations(certifi.where())
    return context


class Poster:
    """Safe to share between threads. Ignores proxies of the environment: they would resolve names."""

    def __init__(self, guard: Guard) -> None:
        self._guard = guard
        self._pool = httpcore.ConnectionPool(
            ssl_context=tls_context(),
            network_backend=GuardedBackend(guard),
            max_connections=32,
            max_keepalive_connections=0,
        )

    def close(self) -> None:
        """Drop the connections."""
        self._pool.close()

    def post(self, url: str, headers: Mapping[str, str], body: bytes) -> Answer:
        """Send one message. Errors of the receiver are in the answer, not raised."""
        started = time.monotonic()
        sent: dict[bytes | str, bytes | str] = {
            "Host": urlsplit(url).netloc,
            "Content-Type": "application/json",
            "Content-Length": str(len(body)),
            "User-Agent": f"cusp/{version.VERSION}",
        }
        sent |= dict(headers.items())
        timeout = dict.fromkeys(("connect", "read", "write", "pool"), TIMEOUT_S)
        try:
            self._guard.check_url(url)  # the allowed networks may have changed since the job was accepted
            with self._pool.stream(
                "POST", url, headers=sent, content=body, extensions={"timeout": timeout}
            ) as answer:
                answered = {key.lower(): value for key, value in answer.headers}
                delay = answered.get(b"retry-after", b"")
                retry_after_s = min(int(delay), MAX_RETRY_AFTER_S) if delay.isdigit() else 0
                return Answer(answer.status, None, time.monotonic() - started, retry_after_s)
        except ForbiddenAddress as error:
            return Answer(None, str(error), time.monotonic() - started, is_forbidden=True)
        except (
            httpcore.NetworkError,
            httpcore.TimeoutException,
            httpcore.ProtocolError,
            ValueError,
        ) as error:
            reason = str(error) or type(error).__name__
            return Answer(None, reason[:300], time.monotonic() - started)
