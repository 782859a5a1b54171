"""Who may use a service without keys: programs on this machine and the service's own page, but no other web
page.

A browser sends requests for every page that it shows. A page whose name resolves to 127.0.0.1 (DNS rebinding)
could read all jobs, and a page that posts a form across origins could start jobs. So the Host must be a
loopback name, and a request that changes something must not come from another origin. With keys this is not
needed, since other pages have no key.
"""

from ipaddress import ip_address
from urllib.parse import urlsplit

from fastapi import Request

from service.contract.errors import Forbidden

READS = ("GET", "HEAD", "OPTIONS")
REMEDY = (
    "make a key (`cusp keys create`), or set CUSP_ALLOW_OPEN=1 if a proxy or a firewall guards the service"
)


def check_origin(request: Request, *, allow_open: bool) -> None:
    """Check a request to a service without keys.

    allow_open : a proxy guards the service under any name; only requests that browsers mark cross-site are
    refused

    Raises
    ------
    Forbidden
    """
    host = request.headers.get("host", "")
    if not allow_open and host and not _is_loopback(host):
        raise Forbidden(f"without API keys only localhost may be addressed, not {host[:100]!r}; {REMEDY}")
    if request.method in READS:
        return
    origin = request.headers.get("origin")
    is_foreign = request.headers.get("sec-fetch-site") == "cross-site"
    if is_foreign or (not allow_open and origin is not None and _netloc(origin) != host):
        raise Forbidden(
            f"without API keys pages of another origin may not write ({(origin or '')[:100]!r}); {REMEDY}"
        )


def _netloc(origin: str) -> str:
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return ""


def _is_loopback(host: str) -> bool:
    try:
        name = (urlsplit(f"//{host}").hostname or "").rstrip(".")
        return name == "localhost" or ip_address(name).is_loopback
    except ValueError:
        return False
