"""Named regions, limits and alignment that a tenant keeps with a design."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.storage.design_faces import DesignFaces
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem
from tests.support.step_files import Step

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


def test_limits_that_a_job_leaves_out_are_those_of_the_design(service: Service, address: str) -> None:
    share, fit = '{"acceptance": {"min_within": 0.9}}', '{"alignment": {"kind": "tolerance_fit"}}'
    both = '{"acceptance": {"min_coverage": 0.9}, "alignment": {"kind": "tolerance_fit"}}'
    for document, words in ((share, "min_within needs"), (fit, "needs limits"), (both, "needs limits")):
        assert_problem(service.submit(document), 422, "invalid_options", words)
    assert options_of_new_job(service, share[:-1] + ', "tolerance_mm": 0.4}')["tolerance_mm"] == 0.4
    assert service.http.put(address, json={"tolerance_mm": 0.3}).status_code == 201
    assert options_of_new_job(service, both)["tolerance_mm"] == 0.3
    limits = {"lower_mm": -0.1, "upper_mm": 0.2}
    assert service.http.put(address, json={"acceptance": limits, "tolerance_mm": 0.3}).status_code == 200
    for document, part in ((share, "acceptance"), (fit, "acceptance"), (both, "alignment")):
        taken = options_of_new_job(service, document)[part]
        assert {name: taken[name] for name in limits} == limits


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


def test_faces_of_a_cad_model_are_known_once_it_was_analysed(service: Service, tmp_path: Path) -> None:
    step = Step()
    step.product("part", [step.solid(step.box_faces(np.ones(3)), "block")])
    design = service.http.put("/v1/blobs", params={"filename": "d.step"}, content=step.text()).json()["id"]
    source = {"blob": design, "filename": "d.step"}

    def post(*faces: object) -> Any:
        region = {"name": "a", "region": {"kind": "brep_faces", "faces": faces}, "upper_mm": 1}
        options = {"acceptance": {"upper_mm": 1, "regions": [region]}}
        return service.http.post("/v1/jobs", json={"design": source, "scan": source, "options": options})

    assert post("bore", 17).status_code == 202  # not known yet: the job will tell
    (tmp_path / "design.brep_faces.csv").write_text("number,name,kind\n0,bore,plane\n1,,plane\n2,rim,plane\n")
    faces = DesignFaces(service.blobs.store)
    faces.keep("default", source, None, tmp_path)
    assert post("bore", 2).status_code == 202
    at = "options.acceptance.regions.0.region.faces: the design has no face"
    assert_problem(post("bore", 3), 422, "invalid_options", at, "3; it has 3 (0 to 2): 'bore', 'rim'")
    assert_problem(post("boer"), 422, "invalid_options", at, "'boer'")
    assert faces.names("another tenant", source, None) is None


def test_a_design_must_be_stored_first(service: Service) -> None:
    address = f"/v1/designs/sha256:{'0' * 64}/characteristics"
    assert_problem(service.http.put(address, json={}), 422, "unknown_blob")
