"""The types of jobs: each with its own meshes and options; what belongs to another type is refused by
name.
"""

import json
from pathlib import Path
from typing import Any

import pytest

from service.client.sync import Client
from service.contract.options import parse_options, resolve_settings
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem

ONE_MESH = ("landmarks", "study")


@pytest.mark.parametrize("kind", ONE_MESH)
def test_a_form_with_one_mesh_starts_a_job_of_its_type(service: Service, kind: str) -> None:
    answer = service.submit_one(kind, '{"units": {"mesh": "cm"}, "seed": 5, "label": "part 7"}')
    job = answer.json()
    assert answer.status_code == 202, answer.text
    assert (job["type"], job["status"], job["label"]) == (kind, "accepted", "part 7")
    service.worker.run(job["id"])
    (task,) = service.sandbox.tasks
    assert (task["type"], task["seed"], task["mesh"]["unit"], task["mesh"]["filename"]) == (
        kind,
        5,
        "cm",
        "m.obj",
    )
    assert "design" not in task
    assert service.status(job["id"])["status"] == "successful"


@pytest.mark.parametrize("kind", ONE_MESH)
def test_json_with_a_blob_starts_a_job_of_its_type(service: Service, kind: str) -> None:
    blob = service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "m.obj"}).json()["id"]
    answer = service.http.post(
        "/v1/jobs", json={"type": kind, "mesh": {"blob": blob}, "options": {"seed": 3}}
    )
    assert answer.status_code == 202, answer.text
    assert answer.json()["type"] == kind
    service.worker.run(answer.json()["id"])
    assert (service.sandbox.tasks[0]["type"], service.sandbox.tasks[0]["seed"]) == (kind, 3)
    unknown = {"type": kind, "mesh": {"blob": "sha256:" + "0" * 64}}
    assert_problem(service.http.post("/v1/jobs", json=unknown), 422, "unknown_blob", "mesh: no blob")


@pytest.mark.parametrize("kind", ["registration", *ONE_MESH])
def test_the_client_sends_every_type(service: Service, kind: Any, tmp_path: Path) -> None:
    path = tmp_path / "part.obj"
    path.write_bytes(TRIANGLE_OBJ)
    meshes = [path, path] if kind == "registration" else [path]
    with Client(str(service.http.base_url)) as client:
        assert client.submit(*meshes, job_type=kind).type == kind
        with pytest.raises(ValueError, match=f"a {kind} job takes "):
            client.submit(*([path, path] if len(meshes) == 1 else [path]), job_type=kind)


def test_a_registration_is_what_a_job_without_a_type_is(service: Service) -> None:
    assert service.submit().json()["type"] == "registration"
    service.worker.run(service.waiting[0])
    assert service.sandbox.tasks[0]["type"] == "registration"


def test_a_listing_is_filtered_by_type(service: Service) -> None:
    ids = {kind: service.submit_one(kind).json()["id"] for kind in ONE_MESH} | {
        "registration": service.submitted()
    }
    for kind, job_id in ids.items():
        jobs = service.http.get("/v1/jobs", params={"type": kind}).json()["jobs"]
        assert [job["id"] for job in jobs] == [job_id]


def test_a_type_that_is_none_is_refused_with_those_that_are(service: Service) -> None:
    words = ("'nonsense'", "registration, landmarks or study")
    assert_problem(service.submit_one("nonsense"), 422, "unsupported_type", *words)
    assert_problem(service.http.post("/v1/jobs", json={"type": "nonsense"}), 422, "unsupported_type", *words)
    assert_problem(
        service.http.post("/v1/jobs", json={"type": ["study"]}), 422, "unsupported_type", "['study']"
    )


FILE = ("m.obj", TRIANGLE_OBJ)


@pytest.mark.parametrize(
    ("kind", "parts", "words"),
    [
        (
            "landmarks",
            ("design",),
            "design: a landmarks job takes mesh instead; design is for type registration",
        ),
        ("study", ("mesh", "scan"), "scan: a study job takes mesh instead; scan is for type registration"),
        (
            "registration",
            ("design", "mesh", "scan"),
            "mesh: a registration job takes design and scan instead; mesh is for type landmarks or study",
        ),
        ("landmarks", ("mesh", "source"), "source: unknown"),
        ("study", (), "mesh: "),
    ],
)
def test_a_part_of_another_type_is_named(
    service: Service, kind: str, parts: tuple[str, ...], words: str
) -> None:
    form = service.http.post("/v1/jobs", files=dict.fromkeys((*parts, "type"), FILE) | {"type": (None, kind)})
    assert_problem(form, 422, "invalid_request", words)
    blob = service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "m.obj"}).json()["id"]
    body = {name: {"blob": blob} for name in parts} | {"type": kind}
    answer = service.http.post("/v1/jobs", json=body)
    assert_problem(answer, 422, "invalid_request", words)
    assert answer.json()["errors"][0]["pointer"] == "/" + words.split(":")[0]
    assert service.waiting == []


def test_a_mesh_without_a_type_is_told_which_types_take_it(service: Service) -> None:
    answer = service.http.post("/v1/jobs", files={"mesh": FILE})
    assert_problem(answer, 422, "invalid_request", "mesh: ", "landmarks or study")


def test_a_file_that_cannot_be_a_mesh_is_refused_under_its_name(service: Service) -> None:
    answer = service.submit_one("study", mesh=("m.stl", b""))
    assert_problem(answer, 422, "empty_file", "mesh: the file is empty")
    assert answer.json()["mesh"] == "mesh"


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("landmarks", {"study": {"trials": 3}}, "options.study: does not apply to a landmarks job"),
        ("registration", {"study": {}}, "options.study: does not apply to a registration job"),
        ("landmarks", {"tolerance_mm": 0.1}, "options.tolerance_mm: does not apply to a landmarks job"),
        ("study", {"scan_accuracy_mm": 0.05}, "options.scan_accuracy_mm: does not apply to a study job"),
        (
            "study",
            {"units": {"design": "mm"}},
            "options.units.design: a study job has no such mesh, only mesh",
        ),
        (
            "registration",
            {"units": {"mesh": "mm"}},
            "options.units.mesh: a registration job has no such mesh",
        ),
        ("landmarks", {"design_part": "2"}, "options.design_part: does not apply to a landmarks job"),
        ("study", {"columns": "x,y,z"}, "options.columns: does not apply to a study job"),
        ("registration", {"columns": "x,y"}, "options.columns: "),
        ("registration", {"design_part": ""}, "options.design_part"),
        ("study", {"units": {"mesh": "ell"}}, "options.units.mesh"),
        ("study", {"study": {"kind": "guess"}}, "options.study.kind"),
        ("study", {"study": {"trials": 0}}, "options.study.trials"),
        ("study", {"study": {"trails": 10}}, "options.study.trails: unknown key"),
        ("study", {"study": {"detectors": ["t2", "voodoo"]}}, "options.study.detectors.1"),
        ("study", {"study": {"detectors": []}}, "options.study.detectors"),
        ("study", {"study": 3}, "options.study"),
        ("study", {"settings": {"study": {"eps": 2}}}, "options.settings.study.eps"),
    ],
)
def test_a_wrong_option_is_named(service: Service, kind: str, options: dict[str, Any], words: str) -> None:
    text = json.dumps(options)
    form = service.submit(text) if kind == "registration" else service.submit_one(kind, text)
    assert_problem(form, 422, "invalid_options", words)
    names = ("design", "scan") if kind == "registration" else ("mesh",)
    blob = service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "m.obj"}).json()["id"]
    body = {name: {"blob": blob} for name in names} | {"type": kind, "options": options}
    answer = service.http.post("/v1/jobs", json=body)
    assert_problem(answer, 422, "invalid_options", words)
    assert answer.json()["errors"][0]["pointer"].startswith("/" + words.split(":")[0].replace(".", "/"))
    assert service.waiting == []


@pytest.mark.parametrize("kind", ["registration", *ONE_MESH])
def test_defaults_of_every_option_are_taken_by_every_type(service: Service, kind: str) -> None:
    units = {"design": "auto", "scan": "auto", "mesh": "auto"}
    nothing = dict.fromkeys(("tolerance_mm", "scan_accuracy_mm", "study", "webhook", "label"))
    text = json.dumps({"units": units, **nothing})
    answer = service.submit(text) if kind == "registration" else service.submit_one(kind, text)
    assert answer.status_code == 202, answer.text


# --- options.study


def test_study_goes_over_the_settings_which_go_over_the_preset(service: Service) -> None:
    options = {
        "preset": "paper",
        "settings": {"study": {"trials": 50, "rotation_deg": 90}},
        "study": {"trials": 20, "detectors": ["t2", "iss"]},
    }
    answer = service.submit_one("study", json.dumps(options))
    service.worker.run(answer.json()["id"])
    told = service.sandbox.tasks[0]["settings"]["study"]
    assert (told["trials"], told["detectors"]) == (20, ["t2", "iss"])  # sent as options.study
    assert told["rotation_deg"] == 90  # as options.settings
    assert told["noise_mm"] == 2.5  # of the preset
    assert (told["kind"], told["count"]) == ("informativeness", None)  # the default


def test_a_null_of_study_is_a_value_too() -> None:
    options = parse_options({"preset": "paper", "study": {"noise_mm": None}})
    assert resolve_settings(options).study.noise_mm is None
    assert resolve_settings(parse_options({"preset": "paper", "study": {}})).study.noise_mm == 2.5


def test_options_survive_their_row(service: Service) -> None:
    sent = {"kind": "repeatability", "eps": 0.02}
    job_id = service.submit_one("study", json.dumps({"study": sent})).json()["id"]
    row = service.jobs.get(job_id)
    assert row is not None
    assert row.options["study"] == sent
