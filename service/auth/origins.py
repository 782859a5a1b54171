"""Who may ask a service that asks for no key: this machine's own programs and its own page, not any page of the web.

A browser sends requests for every page that it shows. One whose name leads to 127.0.0.1 (DNS rebinding) would read all there
is, and one that posts a form from elsewhere would start jobs. So the name that was asked for has to be loopback's, and what
changes something must not come from a page of another origin. With keys none of this is needed: a page has none.
"""

from ipaddress import ip_address
from urllib.parse import urlsplit

from fastapi import Request

from service.contract.errors import Forbidden

READS = ("GET", "HEAD", "OPTIONS")
REMEDY = "make a key (`cusp keys create`), or set CUSP_ALLOW_OPEN=1 where something else guards the service"


def check_origin(request: Request, *, allow_open: bool) -> None:
    """Of a request to a service without keys.

    allow_open : something else guards it, and may give it any name: then only what browsers themselves call foreign is refused

    Raises
    ------
    Forbidden
    """
    host = request.headers.get("host", "")
    if not allow_open and host and not _is_loopback(host):
        raise Forbidden(f"without API keys only localhost is answered, not {host[:100]!r}; {REMEDY}")
    if request.method in READS:
        return
    origin = request.headers.get("origin")
    is_foreign = request.headers.get("sec-fetch-site") == "cross-site"
    if is_foreign or (not allow_open and origin is not None and _netloc(origin) != host):
        raise Forbidden(
            f"without API keys no page of another origin may change anything ({(origin or '')[:100]!r}); {REMEDY}"
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
