"""The OpenAPI document: what FastAPI generates, completed by what it cannot infer."""

import json
from importlib import resources
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from pipeline import Characteristics
from service.api.examples import examples
from service.api.problems import MEDIA_TYPE as PROBLEM_TYPE
from service.api.problems import problems
from service.api.request_bodies import EXTRA_SCHEMAS
from service.contract.schemas import BatchRequest, Problem

DESCRIPTION = """Registers the scan of a 3D-printed part to its design, without manually picked points.

POST two meshes, poll the job, get JSON: verdict, transform, landmarks, RMSEs, deviation, and links to files.
POST one mesh to get its segments and landmarks (`type` `landmarks`), or a study of its landmarks (`study`).
Every error is an RFC 9457 problem with a stable `code`."""

#: `Schema.field` -> a value from the example documents (`python -m tests.support.field_examples`).
FIELD_EXAMPLES: dict[str, Any] = json.loads(
    resources.files("service.api").joinpath("field_examples.json").read_text()
)


WITHOUT_DATABASE = ("/livez", "/version")


def describe(app: FastAPI) -> None:
    """Make `app.openapi()` return the complete document."""

    def document() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _document(app)
        return app.openapi_schema

    app.openapi = document  # type: ignore[method-assign] # FastAPI's documented way


def _document(app: FastAPI) -> dict[str, Any]:
    document = get_openapi(title=app.title, version=app.version, description=DESCRIPTION, routes=app.routes)
    schemas = document["components"]["schemas"]
    for model in (*EXTRA_SCHEMAS, BatchRequest, Characteristics, Problem):
        own = model.model_json_schema(ref_template="#/components/schemas/{model}")
        schemas |= own.pop("$defs", {})
        schemas[model.__name__] = own
    for path, operation in (
        (path, each) for path, ways in document["paths"].items() for each in ways.values()
    ):
        answers = operation["responses"]
        if path not in WITHOUT_DATABASE:
            answers.setdefault("503", problems(503)[503])  # the database may be unavailable
        if "application/json" in answers.get("422", {}).get("content", {}):
            answers["422"] = problems(422)[422]
        for status, answer in answers.items():
            if PROBLEM_TYPE in answer.get("content", {}):
                answer["content"][PROBLEM_TYPE]["examples"] = _problem_examples(int(status))
    request = document["paths"]["/v1/jobs"]["post"]["requestBody"]["content"]["application/json"]
    request["examples"] = {
        name.split(".")[1]: {"value": each}
        for name, each in examples().items()
        if name.startswith("job_request.")
    }
    for name, schema in schemas.items():
        for field, described in schema.get("properties", {}).items():
            if f"{name}.{field}" in FIELD_EXAMPLES:
                described["examples"] = [FIELD_EXAMPLES[f"{name}.{field}"]]
    for unused in ("HTTPValidationError", "ValidationError"):  # ours are problems
        schemas.pop(unused, None)
    document["components"]["schemas"] = dict(sorted(schemas.items()))
    return document


def _problem_examples(status: int) -> dict[str, Any]:
    """Every problem with this status, by its code."""
    matching = [
        each for name, each in examples().items() if name.startswith("problem.") and each["status"] == status
    ]
    return {each["code"]: {"value": each} for each in matching}
