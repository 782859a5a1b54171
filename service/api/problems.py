"""Errors as RFC 9457: every exception that leaves a handler becomes `application/problem+json`."""

import uuid
from collections.abc import Mapping
from typing import Any

import structlog
from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from pipeline import PipelineError
from service.contract.errors import (
    BadRequest,
    InternalError,
    InvalidRequest,
    MethodNotAllowed,
    NotFound,
    NotReady,
    ServiceError,
    Unauthorized,
    problem_of,
)
from service.contract.invalid_values import problem_item, reason
from service.contract.schemas import Problem
from service.storage.retry import unavailable_dependency

MEDIA_TYPE = "application/problem+json"
log = structlog.get_logger()


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """For the OpenAPI document: answers with these statuses are problems."""
    schema = {"$ref": "#/components/schemas/Problem"}
    return {
        status: {"description": "A problem.", "content": {MEDIA_TYPE: {"schema": schema}}}
        for status in statuses
    }


def problem_response(problem: Problem | dict[str, Any], headers: Mapping[str, str] | None = None) -> Response:
    """A problem as an HTTP answer with its own status."""
    document = problem if isinstance(problem, Problem) else Problem.model_validate(problem)
    body = document.model_dump_json(exclude_none=True)
    return Response(body, status_code=document.status, media_type=MEDIA_TYPE, headers=dict(headers or {}))


def install(app: FastAPI) -> None:
    """Answer every error by its row in the table."""
    app.add_exception_handler(ServiceError, _on_own_error)
    app.add_exception_handler(PipelineError, _on_own_error)
    app.add_exception_handler(RequestValidationError, _on_invalid_request)
    app.add_exception_handler(ClientDisconnect, _on_disconnect)
    app.add_exception_handler(HTTPException, _on_http_exception)
    app.add_middleware(CatchAll)


class CatchAll:
    """ASGI middleware: an unexpected exception becomes a 500 problem and is logged once; the connection stays
    open.

    Starlette's handler of 500 raises again, so the server would log the exception a second time.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, and catch."""
        has_started = False

        async def send_noting(message: Message) -> None:
            nonlocal has_started
            has_started = has_started or message["type"] == "http.response.start"
            await send(message)

        try:
            await self._app(scope, receive, send_noting)
        except Exception as error:
            if has_started or scope["type"] != "http":
                raise  # too late for another answer: the server closes the connection
            await _on_unexpected(Request(scope), error)(scope, receive, send)


def _on_own_error(_: Request, error: Exception) -> Response:
    assert isinstance(error, ServiceError | PipelineError)  # noqa: S101 (tells the type checker)
    headers = {}
    if isinstance(error, ServiceError) and error.retry_after_s is not None:
        headers["Retry-After"] = str(error.retry_after_s)
    if isinstance(error, Unauthorized):
        headers["WWW-Authenticate"] = 'Bearer realm="cusp"'
    return problem_response(problem_of(error), headers)


def _on_invalid_request(_: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)  # noqa: S101 (tells the type checker)
    items = [problem_item("/" + "/".join(map(str, each["loc"])), reason(each)) for each in error.errors()]
    detail = "; ".join(
        f"{item.pointer.removeprefix('/').replace('/', ' ')}: {item.detail}" for item in items[:3]
    )
    return problem_response(problem_of(InvalidRequest(detail, errors=items)))


def _on_disconnect(request: Request, _: Exception) -> Response:
    """The client closed the connection within its request: nobody reads this answer."""
    log.info("client closed the connection", path=request.url.path)
    return problem_response(problem_of(BadRequest("the connection was closed before the end of the request")))


def _on_http_exception(request: Request, error: Exception) -> Response:
    """What Starlette raises itself: no route, no method, a body that cannot be parsed."""
    assert isinstance(error, HTTPException)  # noqa: S101 (tells the type checker)
    match error.status_code:
        case 404:
            known: ServiceError = NotFound(
                f"there is nothing at {request.url.path}; /docs lists the addresses"
            )
        case 405:
            known = MethodNotAllowed(
                f"{request.url.path} does not take {request.method}; /docs lists the methods of each address"
            )
        case status if status < 500:
            known = BadRequest(
                f"the request cannot be read ({str(error.detail).rstrip('.')}); "
                "of a form, let the HTTP client set Content-Type"
            )
        case _:
            return _on_unexpected(request, error)
    return problem_response(problem_of(known), error.headers)


def _on_unexpected(request: Request, error: Exception) -> Response:
    """503 if a dependency is unavailable, else 500: the client gets an id, and the log the stack under this
    id.
    """
    if (unavailable := unavailable_dependency(error)) is not None:
        reason = str(error).splitlines()[0][:300]
        log.warning("not ready", unavailable=unavailable, path=request.url.path, reason=reason)
        return _on_own_error(request, NotReady(f"{unavailable}; send it again later"))
    instance = f"urn:uuid:{uuid.uuid4()}"
    log.error("unexpected error", instance=instance, path=request.url.path, exc_info=error)
    detail = f"an unexpected error; report it with the id {instance}"
    return problem_response(problem_of(InternalError(detail), instance=instance))
