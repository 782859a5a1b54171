"""The documents in openapi/ are what the service really does."""

import json
from pathlib import Path

import pytest

import pipeline
from service.app import create_app
from service.errors import TABLE, TYPE_PREFIX, ServiceError
from service.examples import examples
from service.openapi import as_text
from service.schemas import Blob, Job, JobRequest, Options, Problem
from service.settings import ServiceSettings

FOLDER = Path(__file__).parents[2] / "openapi"
MODELS = {"job_request": JobRequest, "options": Options, "blob": Blob, "job": Job, "problem": Problem}


def descendants(base: type[Exception]) -> list[type[Exception]]:
    return [each for child in base.__subclasses__() for each in (child, *descendants(child))]


def test_openapi_json_is_up_to_date() -> None:
    document = create_app(ServiceSettings.model_construct()).openapi()
    assert (FOLDER / "openapi.json").read_text() == as_text(document), "run `cusp openapi`"


def test_examples_are_up_to_date() -> None:
    on_disk = {path.name for path in (FOLDER / "examples").glob("*.json") if not path.name.startswith("results.")}
    assert on_disk == set(examples()), "run `cusp openapi`"
    for name, content in examples().items():
        assert (FOLDER / "examples" / name).read_text() == as_text(content), "run `cusp openapi`"


@pytest.mark.parametrize("name", sorted(examples()))
def test_an_example_fits_its_schema(name: str) -> None:
    content = json.loads((FOLDER / "examples" / name).read_text())
    MODELS[name.split(".")[0]].model_validate(content)


@pytest.mark.parametrize("path", sorted((FOLDER / "examples").glob("results.*.json")), ids=lambda path: path.name)
def test_example_results_fit_the_pipelines_record(path: Path) -> None:
    pipeline.RegistrationResult.model_validate_json(path.read_text())


@pytest.mark.parametrize("error", [*descendants(pipeline.PipelineError), *descendants(ServiceError)])
def test_every_error_has_a_row_and_an_example(
    error: type[pipeline.PipelineError] | type[ServiceError],
) -> None:
    assert error in TABLE, f"{error.__name__} has no row in service/errors.py"
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
