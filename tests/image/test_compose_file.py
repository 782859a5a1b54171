"""The compose file is valid by the Compose specification; the schema: `tests/support/compose_spec`."""

import hashlib
import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "tests" / "support" / "compose_spec"
SHA256 = "0dc04bd346dcfee1b1419628fff79937bbf076925f298f272a2b490e2b112bac"
Compose = dict[str, Any]


@pytest.fixture
def compose() -> Compose:
    read: Compose = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
    return read


def errors(compose: Compose) -> list[str]:
    """Where the schema does not hold."""
    schema = json.loads((FOLDER / "compose_spec.json").read_text())
    # It names draft 2019-09, but uses `$ref` and `definitions` of draft 7 only, by which Compose reads it.
    found = jsonschema.Draft7Validator(schema).iter_errors(compose)
    return sorted("/".join(map(str, each.absolute_path)) for each in found)


def test_the_schema_is_the_one_that_was_published() -> None:
    assert hashlib.sha256((FOLDER / "compose_spec.json").read_bytes()).hexdigest() == SHA256
    assert (FOLDER / "LICENSE").is_file()


def test_the_compose_file_is_valid(compose: Compose) -> None:
    assert errors(compose) == []


def test_planted_faults_are_found_where_they_are(compose: Compose) -> None:
    compose["services"]["cusp"]["prots"] = ["8000:8000"]  # an unknown key
    compose["services"]["api"]["healthcheck"] = {"retries": "three"}  # a wrong type
    compose["services"]["worker"]["depends_on"] = {"postgres": {"condition": "service_happy"}}  # a wrong word
    found = errors(compose)
    assert "services/cusp" in found
    assert "services/api/healthcheck/retries" in found
    assert any(place.startswith("services/worker/depends_on") for place in found)
    assert len(found) == 3


def test_a_volume_that_is_no_volume_is_found(compose: Compose) -> None:
    compose["volumes"] = ["data"]
    assert errors(compose) == ["volumes"]
