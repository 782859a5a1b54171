"""Keys: who holds one may do what it says, to what is their tenant's, and nobody learns that there is
more.
"""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from sqlalchemy import Engine, text
from typer.testing import CliRunner

from service.api.app import create_app
from service.auth.keys import ANYBODY, BadTenant, Exposed, KeyStore, Scope
from service.cli.main import app as cli
from service.execution.supervisor import prepare
from service.settings import ServiceSettings
from service.storage.database import open_database
from tests.support.service import TRIANGLE_OBJ, Service, http_client

pytestmark = pytest.mark.storages

BOTH = [Scope.READ, Scope.WRITE]
OPEN = {"/livez", "/readyz", "/version"}  # and the documentation


@pytest.fixture
def engine(settings: ServiceSettings) -> Iterator[Engine]:
    engine = open_database(settings.database)
    yield engine
    engine.dispose()


@pytest.fixture
def keys(engine: Engine) -> KeyStore:
    return KeyStore(engine)


def bearer(key: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {key}"}


def as_tenant(service: Service, keys: KeyStore, tenant: str, scopes: list[Scope] = BOTH) -> httpx.Client:
    _, key = keys.create(tenant, scopes)
    return http_client(str(service.http.base_url), headers=bearer(key))


def submitted(http: httpx.Client) -> httpx.Response:
    return http.post("/v1/jobs", files={"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ)})


def test_a_key_is_known_by_its_whole_text_and_stored_as_a_hash_only(
    keys: KeyStore, settings: ServiceSettings
) -> None:
    row, key = keys.create("acme", [Scope.READ], "line 2")
    secret = key.split("_", 2)[2]
    caller = keys.caller(key)
    assert caller is not None
    assert (caller.tenant, caller.scopes, caller.key_id) == ("acme", {Scope.READ}, row.id)
    for wrong in (
        key[:-1],
        key + "x",
        key.replace("cusp_", "cups_"),
        f"cusp_{row.id}_",
        f"cusp_{row.id}",
        "cusp__",
        "",
    ):
        assert keys.caller(wrong) is None, wrong
    for path in settings.data_dir.glob("cusp.db*"):
        assert secret.encode() not in path.read_bytes()


def test_a_revoked_key_is_refused_and_does_not_open_the_service(service: Service, keys: KeyStore) -> None:
    assert service.http.get("/v1/jobs").status_code == 200  # nobody made a key yet
    row, key = keys.create("acme", BOTH)
    assert service.http.get("/v1/jobs", headers=bearer(key)).status_code == 200
    assert keys.revoke(row.id)
    assert not keys.revoke(row.id)
    answer = service.http.get("/v1/jobs", headers=bearer(key))
    assert (answer.status_code, answer.json()["code"]) == (401, "unauthorized")
    assert answer.headers["WWW-Authenticate"].startswith("Bearer")
    assert service.http.get("/v1/jobs").status_code == 401


@pytest.mark.parametrize(
    "header", [{}, {"Authorization": "Basic YTpi"}, {"Authorization": "Bearer"}, bearer("cusp_a_b")]
)
def test_every_address_but_the_probes_needs_a_key(
    service: Service, keys: KeyStore, header: dict[str, str]
) -> None:
    keys.create("acme", BOTH)
    paths = create_app(service.settings).openapi()["paths"]
    asked = 0
    for path, operations in paths.items():
        for method in operations:
            answer = service.http.request(method, re.sub(r"\{\w+\}", "x", path), headers=header)
            if path in OPEN:
                assert answer.status_code != 401, path
            else:
                asked += 1
                assert answer.status_code == 401, (method, path)
    assert asked >= 9


def test_a_key_allows_what_its_scopes_say(service: Service, keys: KeyStore) -> None:
    reads, writes, admin = (
        as_tenant(service, keys, "acme", [scope]) for scope in (Scope.READ, Scope.WRITE, Scope.ADMIN)
    )
    with reads, writes, admin:
        job_id = submitted(writes).json()["id"]
        assert submitted(admin).status_code == 202
        refused = [
            submitted(reads),
            reads.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"}),
            reads.delete(f"/v1/jobs/{job_id}"),
            writes.get(f"/v1/jobs/{job_id}"),
            writes.get("/v1/jobs"),
        ]
        assert [answer.status_code for answer in refused] == [403] * 5
        assert {answer.json()["code"] for answer in refused} == {"forbidden"}
        assert (
            reads.get(f"/v1/jobs/{job_id}").status_code == admin.get(f"/v1/jobs/{job_id}").status_code == 200
        )


def test_another_tenants_job_is_not_there(service: Service, keys: KeyStore) -> None:
    with as_tenant(service, keys, "acme") as own, as_tenant(service, keys, "other") as other:
        job_id = submitted(own).json()["id"]
        service.worker.run(job_id)
        assert own.get(f"/v1/jobs/{job_id}/files/aligned.ply").status_code == 200
        for method, path in (
            *(("GET", ""), ("GET", "/results"), ("GET", "/files"), ("GET", "/files/aligned.ply")),
            *(("GET", "/deliveries"), ("GET", "/events")),
            *(("GET", "/files/results.json"), ("DELETE", "")),
        ):
            answer = other.request(method, f"/v1/jobs/{job_id}{path}")
            assert (answer.status_code, answer.json()["code"]) == (404, "job_not_found"), path
        unknown = other.get(f"/v1/jobs/{job_id[:-1]}0").json()
        assert (
            unknown["detail"].replace(f"{job_id[:-1]}0", job_id)
            == other.get(f"/v1/jobs/{job_id}").json()["detail"]
        )
        assert other.get("/v1/jobs").json()["jobs"] == []
        assert (
            other.get("/v1/jobs", params={"cursor": "ffffffff-ffff-ffff-ffff-ffffffffffff"}).json()["jobs"]
            == []
        )
        assert [job["id"] for job in own.get("/v1/jobs").json()["jobs"]] == [job_id]


def test_another_tenants_blob_is_not_there_until_sent(service: Service, keys: KeyStore) -> None:
    with as_tenant(service, keys, "acme") as own, as_tenant(service, keys, "other") as other:
        blob = own.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"}).json()["id"]
        job = {"design": {"blob": blob}, "scan": {"blob": blob}}
        assert other.head(f"/v1/blobs/{blob}").status_code == 404
        refused = other.post("/v1/jobs", json=job)
        assert (refused.status_code, refused.json()["code"]) == (422, "unknown_blob")
        assert other.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"}).json()["id"] == blob
        assert other.head(f"/v1/blobs/{blob}").status_code == own.head(f"/v1/blobs/{blob}").status_code == 200
        assert (
            other.post("/v1/jobs", json=job).status_code == own.post("/v1/jobs", json=job).status_code == 202
        )


@pytest.mark.parametrize("tenant", ["", "Acme", "a b", "../x", "a/b", "-a", "a" * 65, "a\n", "ä"])
def test_a_tenants_name_is_a_plain_word(keys: KeyStore, tenant: str) -> None:
    with pytest.raises(BadTenant, match="lower-case letters"):
        keys.create(tenant, BOTH)


def test_without_keys_only_this_machine_may_ask(settings: ServiceSettings, keys: KeyStore) -> None:
    exposed = settings.model_copy(update={"host": "0.0.0.0"})  # noqa: S104
    for _ in range(2):  # the lock on the folder is given back each time
        with pytest.raises(Exposed, match="cusp keys create"):
            prepare(exposed)
    prepare(exposed.model_copy(update={"allow_open": True})).close()
    keys.create("acme", BOTH)
    prepare(exposed).close()


def test_the_commands_make_list_and_revoke(
    settings: ServiceSettings, keys: KeyStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable, value in settings.environment().items():
        monkeypatch.setenv(variable, value)

    def run(*words: str) -> str:
        result = CliRunner().invoke(cli, ["keys", *words, "--data-dir", str(settings.data_dir)])
        return f"{result.exit_code} {result.output}"

    key = run("create", "--tenant", "acme", "--scope", "jobs:read", "--name", "line 2").split()[1]
    caller = keys.caller(key)
    assert caller is not None and caller.scopes == {Scope.READ}
    (told,) = json.loads(run("list", "--json")[2:])
    assert (told["tenant"], told["name"], told["revoked"]) == ("acme", "line 2", None)
    assert key not in run("list")
    assert run("revoke", told["id"]).startswith("0")
    assert keys.caller(key) is None
    assert run("revoke", told["id"]).startswith("1")
    assert run("create", "--tenant", "A B").startswith("1")


def test_what_was_there_before_tenants_is_the_open_services(tmp_path: Path) -> None:
    """A database of the version before: its jobs and blobs are found again, and survive the way back."""
    from alembic import command
    from alembic.config import Config

    path = tmp_path / "cusp.db"
    engine = open_database(f"sqlite:///{path}")
    config = Config()
    config.set_main_option("script_location", "service.storage:migrations")
    with engine.begin() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, "0001")
        connection.execute(text("INSERT INTO blobs VALUES ('sha256:a', 3, 'stl', 1)"))
        connection.execute(
            text(
                "INSERT INTO jobs (id, type, status, progress, inputs, options, attempt, crashes, "
                "created_ms) "
                "VALUES ('j', 'registration', 'accepted', 0, '{}', '{}', 0, 0, 1)"
            )
        )
        command.upgrade(config, "head")
        for table in ("jobs", "blobs"):
            assert connection.scalar(text(f"SELECT tenant FROM {table}")) == ANYBODY.tenant  # noqa: S608
        command.downgrade(config, "0001")
        assert connection.scalar(text("SELECT size FROM blobs")) == 3
        assert connection.scalar(text("SELECT status FROM jobs")) == "accepted"
    engine.dispose()
