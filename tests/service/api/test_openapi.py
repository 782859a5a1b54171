"""The documents in openapi/ are what the service really does."""

import json
from pathlib import Path

import jsonschema
import pytest
from pydantic import TypeAdapter

import pipeline
from service.api.app import create_app
from service.api.examples import examples
from service.api.openapi_files import as_text
from service.contract.errors import TABLE, TYPE_PREFIX, ServiceError
from service.contract.job_types import JOB_TYPES
from service.contract.schemas import Blob, Job, JobRequest, Options, Problem, Results
from service.settings import ServiceSettings
from tests.support import field_examples

FOLDER = Path(__file__).parents[3] / "openapi"
MODELS: dict[str, object] = {
    "job_request": JobRequest,
    "options": Options,
    "blob": Blob,
    "job": Job,
    "problem": Problem,
    "results": Results,
}
RESULTS = sorted(path.name for path in (FOLDER / "examples").glob("results.*.json"))


def descendants(base: type[Exception]) -> list[type[Exception]]:
    return [each for child in base.__subclasses__() for each in (child, *descendants(child))]


def test_openapi_json_is_up_to_date() -> None:
    document = create_app(ServiceSettings.model_construct()).openapi()
    assert (FOLDER / "openapi.json").read_text() == as_text(document), "run `cusp openapi`"


def test_every_field_and_parameter_says_what_it_is_and_shows_one() -> None:
    document = create_app(ServiceSettings.model_construct()).openapi()
    schemas = document["components"]["schemas"]
    fields = {
        f"{name}.{field}": each
        for name, schema in schemas.items()
        for field, each in schema.get("properties", {}).items()
    }
    assert len(fields) > 250
    assert not [name for name, each in fields.items() if "description" not in each]
    # What is an object has its examples inside.
    assert not [
        name for name, each in fields.items() if "examples" not in each and "$ref" not in json.dumps(each)
    ]
    for name, each in fields.items():
        for example in each.get("examples", []):
            jsonschema.validate(example, {**each, "components": document["components"]}), name
    parameters = [
        each
        for path in document["paths"].values()
        for way in path.values()
        for each in way.get("parameters", [])
    ]
    assert parameters and all("description" in each for each in parameters)


def test_field_examples_are_up_to_date() -> None:
    schemas = create_app(ServiceSettings.model_construct()).openapi()["components"]["schemas"]
    assert json.loads(field_examples.FOUND.read_text()) == field_examples.collected(schemas), (
        "run `python -m tests.support.field_examples`, then `cusp openapi`"
    )


def test_examples_are_up_to_date() -> None:
    on_disk = {
        path.name for path in (FOLDER / "examples").glob("*.json") if not path.name.startswith("results.")
    }
    assert on_disk == set(examples()), "run `cusp openapi`"
    for name, content in examples().items():
        assert (FOLDER / "examples" / name).read_text() == as_text(content), "run `cusp openapi`"


@pytest.mark.parametrize("name", [*sorted(examples()), *RESULTS])
def test_an_example_fits_its_schema(name: str) -> None:
    TypeAdapter(MODELS[name.split(".")[0]]).validate_json((FOLDER / "examples" / name).read_text())


@pytest.mark.parametrize("kind", JOB_TYPES)
def test_every_type_has_an_example_of_its_request_and_of_its_results(kind: str) -> None:
    request = json.loads((FOLDER / "examples" / f"job_request.{kind}.json").read_text())
    assert request.get("type", "registration") == kind
    assert json.loads((FOLDER / "examples" / f"results.{kind}.json").read_text())["type"] == kind


def test_the_document_says_what_each_type_takes_and_answers() -> None:
    document = create_app(ServiceSettings.model_construct()).openapi()
    body = document["paths"]["/v1/jobs"]["post"]["requestBody"]["content"]
    assert [form["title"] for form in body["multipart/form-data"]["schema"]["oneOf"]] == list(JOB_TYPES)
    assert len(body["application/json"]["schema"]["oneOf"]) == len(JOB_TYPES)
    assert set(body["application/json"]["examples"]) == set(JOB_TYPES)
    answer = document["paths"]["/v1/jobs/{job_id}/results"]["get"]["responses"]["200"]["content"]
    assert set(answer["application/json"]["schema"]["discriminator"]["mapping"]) == set(JOB_TYPES)


@pytest.mark.parametrize("error", [*descendants(pipeline.PipelineError), *descendants(ServiceError)])
def test_every_error_has_a_row_and_an_example(
    error: type[pipeline.PipelineError] | type[ServiceError],
) -> None:
    assert error in TABLE, f"{error.__name__} has no row in service/contract/errors.py"
    example = json.loads((FOLDER / "examples" / f"problem.{error.code}.json").read_text())
    assert example["status"] == TABLE[error].status
    assert example["title"] == TABLE[error].title
    assert example["type"] == TYPE_PREFIX + error.code


def test_codes_are_unique() -> None:
    codes = [error.code for error in TABLE if isinstance(error, type)]  # type: ignore[attr-defined]
    assert len(codes) == len(set(codes))


def test_every_reference_of_the_document_resolves() -> None:
    document = create_app(ServiceSettings.model_construct()).openapi()
    text = json.dumps(document)
    for part in text.split('"$ref": "#/components/schemas/')[1:]:
        assert part.split('"')[0] in document["components"]["schemas"]
