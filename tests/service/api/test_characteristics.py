"""Named regions, limits and alignment that a tenant keeps with a design."""

from typing import Any

import pytest

from tests.support.service import TRIANGLE_OBJ, Service, assert_problem

pytestmark = pytest.mark.storages

BOX = {"kind": "box", "min_mm": [0, 0, 0], "max_mm": [1, 1, 1]}
SEAT = {"name": "seat", "region": BOX}
NAMED = {"kind": "named", "name": "seat"}
LIMITS = {"tolerance_mm": 0.3, "regions": [{"name": "tight", "region": NAMED, "tolerance_mm": 0.1}]}
KEPT = {
    "regions": [SEAT],
    "acceptance": LIMITS,
    "alignment": {"kind": "best_fit", "regions": [{"region": NAMED}]},
}


@pytest.fixture
def address(service: Service) -> str:
    blob = service.http.put("/v1/blobs", params={"filename": "d.obj"}, content=TRIANGLE_OBJ).json()["id"]
    return f"/v1/designs/{blob}/characteristics"


def options_of_new_job(service: Service, options: str = "{}") -> dict[str, Any]:
    row = service.jobs.get(service.submitted(options))
    assert row is not None
    return row.options


def test_jobs_take_what_is_kept_with_their_design_unless_they_state_their_own(
    service: Service, address: str
) -> None:
    before = options_of_new_job(service)
    assert (before["acceptance"], before["alignment"]) == (None, None)
    assert service.http.put(address, json=KEPT).status_code == 201
    taken = options_of_new_job(service)
    assert taken["acceptance"]["regions"][0]["region"] == BOX  # what the name stands for
    assert taken["alignment"]["regions"][0]["region"] == BOX
    own = options_of_new_job(service, '{"acceptance": {"upper_mm": 0.5}, "alignment": {"kind": "best_fit"}}')
    assert own["acceptance"]["upper_mm"] == 0.5
    assert own["acceptance"]["regions"] == own["alignment"]["regions"] == []
    one = '{"name": "a", "region": {"kind": "named", "name": "seat"}, "upper_mm": 1}'
    named = '{"acceptance": {"regions": [' + one + "]}}"
    assert options_of_new_job(service, named)["acceptance"]["regions"][0]["region"] == BOX
    wrong = service.submit(named.replace("seat", "sear"))
    assert_problem(wrong, 422, "invalid_options", "options.acceptance: no region is named 'sear'", "'seat'")


def test_a_document_is_changed_only_as_it_is_known(service: Service, address: str) -> None:
    http = service.http
    assert_problem(http.get(address), 404, "no_characteristics")
    assert http.get(address, params={"empty": True}).json()["regions"] == []
    assert_problem(http.put(address, json=KEPT, headers={"If-Match": "*"}), 412, "precondition_failed")
    made = http.put(address, json=KEPT, headers={"If-None-Match": "*"})
    assert made.status_code == 201
    assert_problem(http.put(address, json={}, headers={"If-None-Match": "*"}), 412, "precondition_failed")
    etag = http.get(address).headers["ETag"]
    assert etag == made.headers["ETag"]
    assert http.get(address, headers={"If-None-Match": etag}).status_code == 304
    changed = http.put(address, json={"regions": [SEAT]}, headers={"If-Match": etag})
    assert (changed.status_code, changed.headers["ETag"] == etag) == (200, False)
    assert_problem(http.put(address, json=KEPT, headers={"If-Match": etag}), 412, "precondition_failed")
    found = http.get(address).json()
    assert (found["regions"], found["acceptance"]) == ([SEAT], None)
    assert http.delete(address).status_code == 204
    assert_problem(http.delete(address), 404, "no_characteristics")


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({"regions": [SEAT, SEAT]}, "'seat' is given twice"),
        ({"acceptance": LIMITS}, "no region is named 'seat'"),
        ({"regions": [{"name": "a", "region": NAMED}]}, "regions.0.region"),
        ({"acceptance": {"min_within": 0.9}}, "min_within needs"),
        ({"alignment": {"kind": "tolerance_fit"}}, "needs limits"),
        ({"limits": 3}, "limits: unknown key"),
    ],
)
def test_what_contradicts_is_refused(
    service: Service, address: str, document: dict[str, Any], words: str
) -> None:
    assert_problem(service.http.put(address, json=document), 422, "invalid_request", words)


def test_a_design_must_be_stored_first(service: Service) -> None:
    address = f"/v1/designs/sha256:{'0' * 64}/characteristics"
    assert_problem(service.http.put(address, json={}), 422, "unknown_blob")
