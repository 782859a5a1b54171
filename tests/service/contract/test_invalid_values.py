"""What a client reads about a wrong value: what is allowed, in words, and a pointer that the request has."""

from typing import Any

import pytest
from pydantic import ValidationError

from service.contract.errors import InvalidOptions
from service.contract.options import check_ceilings, invalid_request, parse_options
from service.contract.requests import RegistrationRequest


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"tolerance": 0.2}, "options.tolerance: unknown key; did you mean tolerance_mm?"),
        ({"units": {"skan": "mm"}}, "options.units.skan: unknown key; did you mean scan?"),
        ({"units": {"a": "mm"}}, "options.units.a: unknown key; known are design, scan, mesh"),
        ({"units": {"scan": "mil"}}, "options.units.scan: must be 'auto', 'mm', 'cm',"),
        ({"tolerance_mm": "0,2"}, 'options.tolerance_mm: must be a number, not "0,2"'),
        ({"tolerance_mm": -1}, "options.tolerance_mm: must be above 0, not -1"),
        ({"seed": 1.5}, "options.seed: must be a whole number, not 1.5"),
        ({"webhook": "http://a/b"}, 'options.webhook: must be a JSON object (url), not "http://a/b"'),
        ({"settings": {"landmarks": {"relief": 5}}}, "options.settings.landmarks.relief: unknown key; did"),
        ([], "options: must be a JSON object, not a list"),
    ],
)  # fmt: skip
def test_what_is_allowed_is_said(options: Any, said: str) -> None:
    with pytest.raises(InvalidOptions) as refused:
        parse_options(options)
    assert refused.value.detail.startswith(said)


def test_a_pointer_leads_to_a_place_of_the_request() -> None:
    """Where one of several forms is meant, its name is no step of the path."""
    region = {"name": "rim", "region": {"kind": "sphere", "centre_mm": [0, 0]}, "tolerance_mm": 0.1}
    with pytest.raises(InvalidOptions) as refused:
        parse_options({"acceptance": {"regions": [region]}})
    assert [(each.pointer, each.detail) for each in refused.value.errors or []] == [
        ("/options/acceptance/regions/0/region/centre_mm", "must have at least 3 items, and has 2"),
        ("/options/acceptance/regions/0/region/radius_mm", "missing, but required"),
    ]


def test_a_mesh_that_is_no_reference_is_named_once() -> None:
    body = {"design": "d.stl", "scan": {"blob": "sha256:0"}}
    with pytest.raises(ValidationError) as wrong:
        RegistrationRequest.model_validate(body)
    problem = invalid_request(wrong.value, body, RegistrationRequest)
    assert [(each.pointer, each.detail) for each in problem.errors or []] == [
        ("/design", 'must be a JSON object (blob, filename, url, sha256), not "d.stl"'),
        ("/scan/blob", "must be `sha256:` and 64 hex digits, as PUT /v1/blobs answers"),
    ]


def test_a_ceiling_is_written_in_full() -> None:
    options = parse_options({"settings": {"load": {"max_faces": 100_000_000}}})
    with pytest.raises(InvalidOptions, match="must be at most 5,000,000 on this server, and is 100,000,000"):
        check_ceilings(options, {"load.max_faces": 5e6})
