"""The pages at `/` and `/docs`: the files of `service/web`, with a policy that allows no other source.

Both are on the origin that holds the API key of the reader, so they load nothing from other hosts.
"""

from importlib import resources
from pathlib import Path
from typing import Any

from fastapi import APIRouter
from fastapi.responses import FileResponse
from starlette.responses import Response
from starlette.routing import Mount
from starlette.staticfiles import StaticFiles

WEB = Path(str(resources.files("service") / "web"))
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}

router = APIRouter()


@router.get("/", include_in_schema=False)
def page() -> FileResponse:
    """Serve the page. It needs no key; its requests to the API do, if the service has keys."""
    return FileResponse(WEB / "index.html", headers=HEADERS)


@router.get("/docs", include_in_schema=False)
def docs() -> FileResponse:
    """Serve the OpenAPI document as a page (Swagger UI, from our own files)."""
    return FileResponse(WEB / "docs.html", headers=HEADERS)


class PageFiles(StaticFiles):
    """Static files with the page's headers."""

    def file_response(self, *args: Any, **kwargs: Any) -> Response:
        """See starlette."""
        answer = super().file_response(*args, **kwargs)
        answer.headers.update(HEADERS)
        return answer


assets = Mount("/web", PageFiles(directory=WEB), name="web")
