"""The page at `/`: files as they stand in `service/web`, under a policy that lets nothing else in."""

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
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
GUARDED = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}

router = APIRouter()


@router.get("/", include_in_schema=False)
def page() -> FileResponse:
    """Serve the page; what it asks of the service needs a key where there are keys, the page itself does not."""
    return FileResponse(WEB / "index.html", headers=GUARDED)


class GuardedFiles(StaticFiles):
    """Static files with the page's headers."""

    def file_response(self, *given: Any, **named: Any) -> Response:
        """See starlette."""
        answer = super().file_response(*given, **named)
        answer.headers.update(GUARDED)
        return answer


assets = Mount("/web", GuardedFiles(directory=WEB), name="web")
