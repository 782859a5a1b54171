"""The OpenAPI document: what FastAPI finds, and what it cannot find by itself."""

from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from service.problems import problems
from service.routes.jobs import EXTRA_SCHEMAS
from service.schemas import Problem

DESCRIPTION = """Registers the scan of a 3D-printed part to its design, with nobody picking points.

POST two meshes, poll the job, get JSON: verdict, transform, landmarks, RMSEs, deviation, and the files behind them.
Every error is an RFC 9457 problem with a stable `code`."""


def describe(app: FastAPI) -> None:
    """Have `app.openapi()` answer the whole document."""

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _document(app)
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign] # FastAPI's documented way


def _document(app: FastAPI) -> dict[str, Any]:
    document = get_openapi(title=app.title, version=app.version, description=DESCRIPTION, routes=app.routes)
    schemas = document["components"]["schemas"]
    for model in (*EXTRA_SCHEMAS, Problem):
        own = model.model_json_schema(ref_template="#/components/schemas/{model}")
        schemas |= own.pop("$defs", {})
        schemas[model.__name__] = own
    for operation in (each for path in document["paths"].values() for each in path.values()):
        answers = operation["responses"]
        if "application/json" in answers.get("422", {}).get("content", {}):
            answers["422"] = problems(422)[422]
    for unused in ("HTTPValidationError", "ValidationError"):  # ours are problems
        schemas.pop(unused, None)
    document["components"]["schemas"] = dict(sorted(schemas.items()))
    return document
