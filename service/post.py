"""One POST to an address that a client named: guarded, with a deadline, and without an interest in the answer's body.

The name is looked up once and the connection goes to the very address that was judged, so a name that changes its answer
between the two (DNS rebinding) gains nothing. Redirects are not followed.
"""

import socket
import ssl
import time
from collections.abc import Iterable, Mapping
from ipaddress import ip_address
from urllib.parse import urlsplit

import certifi
import httpcore

from service import version
from service.addresses import ForbiddenAddress, Guard
from service.webhooks import Answer

TIMEOUT_S = 10.0  # to connect, and for each read
MAX_RETRY_AFTER_S = 24 * 3600


class GuardedBackend(httpcore.NetworkBackend):
    """httpcore's way to a socket, with the guard between name and connection."""

    def __init__(self, guard: Guard) -> None:
        self._guard = guard
        self._sockets = httpcore.SyncBackend()

    def connect_tcp(
        self,
        host: str,
        port: int,
        timeout: float | None = None,
        local_address: str | None = None,
        socket_options: Iterable[httpcore.SOCKET_OPTION] | None = None,
    ) -> httpcore.NetworkStream:
        """Look the name up, judge every answer, connect to the first."""
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
        except (OSError, UnicodeError) as error:
            raise httpcore.ConnectError(f"{host} has no address ({error})") from error
        addresses = [str(each[4][0]) for each in found]
        for address in addresses:
            self._guard.check(host, ip_address(address.partition("%")[0]))
        return self._sockets.connect_tcp(addresses[0], port, timeout, local_address, socket_options)

    def sleep(self, seconds: float) -> None:
        """See httpcore."""
        self._sockets.sleep(seconds)


class Poster:
    """Safe to share between threads. No proxy of the environment is used: it would look names up itself."""

    def __init__(self, guard: Guard) -> None:
        context = ssl.create_default_context()  # the system's authorities, and SSL_CERT_FILE
        context.load_verify_locations(certifi.where())
        self._guard = guard
        self._pool = httpcore.ConnectionPool(
            ssl_context=context, network_backend=GuardedBackend(guard), max_connections=32, max_keepalive_connections=0
        )

    def close(self) -> None:
        """Drop the connections."""
        self._pool.close()

    def post(self, url: str, headers: Mapping[str, str], body: bytes) -> Answer:
        """Never raises for what a receiver does."""
        begun = time.monotonic()
        sent: dict[bytes | str, bytes | str] = {
            "Host": urlsplit(url).netloc,
            "Content-Type": "application/json",
            "Content-Length": str(len(body)),
            "User-Agent": f"cusp/{version.VERSION}",
        }
        sent |= dict(headers.items())
        timeout = dict.fromkeys(("connect", "read", "write", "pool"), TIMEOUT_S)
        try:
            self._guard.check_url(url)  # allowed networks may have changed since it was taken
            with self._pool.stream("POST", url, headers=sent, content=body, extensions={"timeout": timeout}) as answer:
                told = {key.lower(): value for key, value in answer.headers}
                waits = told.get(b"retry-after", b"")
                retry_after_s = min(int(waits), MAX_RETRY_AFTER_S) if waits.isdigit() else 0
                return Answer(answer.status, None, time.monotonic() - begun, retry_after_s)
        except ForbiddenAddress as error:
            return Answer(None, str(error), time.monotonic() - begun, is_forbidden=True)
        except (httpcore.NetworkError, httpcore.TimeoutException, httpcore.ProtocolError, ValueError) as error:
            reason = str(error) or type(error).__name__
            return Answer(None, reason[:300], time.monotonic() - begun)
