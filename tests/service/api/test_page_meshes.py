"""A job says which meshes it is about, so that the page (and anybody) can use them again."""

from typing import Any

import httpx
import pytest

from service.auth.keys import KeyStore, Scope
from service.storage.database import open_database
from tests.support.service import TRIANGLE_OBJ, Service

pytestmark = pytest.mark.storages


def inputs(answer: httpx.Response) -> dict[str, Any]:
    assert answer.status_code == 202, answer.text
    found: dict[str, Any] = answer.json()["inputs"]
    return found


def test_a_job_names_its_meshes_as_another_job_may(service: Service) -> None:
    first = inputs(service.submit(scan=("part 42.obj", TRIANGLE_OBJ + b"# scanned\n")))
    assert first["mesh"] is None
    assert first["design"]["filename"] == "d.obj" and first["scan"]["filename"] == "part 42.obj"
    assert first["design"]["blob"] != first["scan"]["blob"]
    again = service.http.post("/v1/jobs", json={"design": first["design"], "scan": first["scan"]})
    assert inputs(again) == first
    listed = service.http.get("/v1/jobs").json()["jobs"]
    assert [each["inputs"] for each in listed] == [first, first]


def test_a_design_becomes_the_mesh_of_another_type_of_job(service: Service) -> None:
    design = inputs(service.submit())["design"]
    answer = service.http.post("/v1/jobs", json={"type": "landmarks", "mesh": design})
    assert inputs(answer) == {"design": None, "scan": None, "mesh": design}


def test_the_meshes_of_another_tenant_are_not_there(service: Service) -> None:
    engine = open_database(service.settings.database)
    keys = KeyStore(engine)
    owner, other = (
        httpx.Client(base_url=service.http.base_url, headers={"Authorization": f"Bearer {key}"}, timeout=30)
        for _, key in (keys.create(name, [Scope.READ, Scope.WRITE]) for name in ("acme", "zenith"))
    )
    with owner, other:
        files = {"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ)}
        given = inputs(owner.post("/v1/jobs", files=files))
        assert other.get("/v1/jobs").json()["jobs"] == []
        answer = other.post("/v1/jobs", json={"design": given["design"], "scan": given["scan"]})
        assert (answer.status_code, answer.json()["code"]) == (422, "unknown_blob")
    engine.dispose()
