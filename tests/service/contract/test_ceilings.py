"""Clients cannot lift the guards of the operator, by any way that a setting can be given."""

import json

import pytest
from pydantic import ValidationError

from pipeline import Settings
from service.ceilings import GUARDS, read_ceilings
from service.settings import ServiceSettings
from tests.support.service import Service, assert_problem


@pytest.mark.parametrize("name", GUARDS)
@pytest.mark.parametrize("preset", ["default", "paper"])
def test_a_guard_cannot_be_lifted(service: Service, name: str, preset: str) -> None:
    section, field = name.split(".")
    value = int(read_ceilings("")[name])
    options = {"preset": preset, "settings": {section: {field: value}}}
    assert service.submit(json.dumps(options)).status_code == 202
    options["settings"] = {section: {field: value + 1}}
    refused = service.submit(json.dumps(options))
    assert_problem(refused, 422, "invalid_options", f"must be at most {value:,.10g}")
    assert refused.json()["errors"][0]["pointer"] == f"/options/settings/{section}/{field}"


def test_a_blob_job_is_checked_too(service: Service) -> None:
    request = {"type": "landmarks", "mesh": {"blob": "sha256:" + "0" * 64}}
    request["options"] = {"settings": {"load": {"max_faces": 10**8}}}
    assert_problem(service.http.post("/v1/jobs", json=request), 422, "invalid_options", "5,000,000")


def test_limits_name_the_ceilings(service: Service) -> None:
    assert service.http.get("/v1/limits").json()["setting_ceilings"] == service.settings.ceilings
    assert set(service.settings.ceilings) == set(GUARDS)


def test_the_operator_raises_and_adds_ceilings() -> None:
    given = ServiceSettings(setting_ceilings="load.max_faces=2e7, study.trials = 500")
    assert given.ceilings["load.max_faces"] == 2e7
    assert given.ceilings["study.trials"] == 500
    assert given.ceilings["load.max_points"] == Settings().load.max_points


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("load.max_faces", "not of the form"),
        ("load.max_face=1e7", "no setting load.max_face"),
        ("clean.fill_holes=1", "no number|no setting"),
        ("load.max_faces=10", "below 5e\\+06, which jobs use by default"),
    ],
)
def test_a_ceiling_that_means_nothing_is_refused_at_the_start(text: str, words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        ServiceSettings(setting_ceilings=text)


@pytest.mark.parametrize(
    "chosen",
    [
        {"registration": {"sample_points": 10**9}},
        {"matching": {"sample_points": 10**9}},
        {"matching": {"max_hypotheses": 10**9}},
        {"matching": {"max_pairs": 10**9}},
        {"matching": {"candidates": 10**9}},
        {"resample": {"max_scan_ratio": 1e9}},
        {"segmentation": {"max_centres": 10**9}},
        {"load": {"max_faces": 10**12}},
    ],
    ids=str,
)
def test_what_costs_time_or_memory_has_an_upper_bound(service: Service, chosen: object) -> None:
    assert_problem(
        service.submit(json.dumps({"settings": chosen})), 422, "invalid_options", "must be at most"
    )


def test_every_count_of_the_settings_has_an_upper_bound() -> None:
    """A new one without it fails here; those of `EXEMPT` only leave something out."""
    exempt = {"landmarks.min_segment_vertices"}
    schema = Settings.model_json_schema()
    without = set()
    for section, ref in schema["properties"].items():
        fields = schema["$defs"][ref["$ref"].rpartition("/")[2]]["properties"] if "$ref" in ref else {}
        for name, field in fields.items():
            kinds = field.get("anyOf", [field])
            if any(each.get("type") == "integer" and "maximum" not in each for each in kinds):
                without.add(f"{section}.{name}")
    assert without <= exempt
