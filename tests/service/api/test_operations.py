"""What whoever runs the service sees: ids in the log and in answers, limits, settings without passwords."""

import json
from collections.abc import Iterator

import pytest
import structlog
from typer.testing import CliRunner

from service.api.app import create_app
from service.api.server import configuration
from service.cli.main import app as cli
from service.settings import ServiceSettings
from tests.support.service import Service, http_client, serving


def test_a_request_has_an_id_in_the_answer_and_in_every_line_of_the_log(
    service: Service, capsys: pytest.CaptureFixture[str]
) -> None:
    renderer = structlog.processors.JSONRenderer()
    before = structlog.get_config()["processors"]
    structlog.configure(processors=[structlog.contextvars.merge_contextvars, renderer])
    try:
        answer = service.http.post(
            "/v1/jobs",
            files={
                "design": ("d.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
                "scan": ("s.txt", b"nothing"),
            },
            headers={"X-Request-Id": "order-7"},
        )
        accepted = service.submit()
    finally:
        structlog.configure(processors=before)
    assert answer.status_code == 415 and answer.headers["X-Request-Id"] == "order-7"
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines() if line.startswith("{")]
    mine = [line for line in lines if line["request_id"] == "order-7"]
    assert [(line["event"], line["status"]) for line in mine] == [("request", 415)]
    own = accepted.headers["X-Request-Id"]
    assert {line["event"] for line in lines if line["request_id"] == own} == {"job accepted", "request"}
    assert any(line.get("job_id") == accepted.json()["id"] for line in lines if line["request_id"] == own)


@pytest.mark.parametrize("given", ["a b", "x" * 101, ""])
def test_an_id_that_would_spoil_the_log_is_replaced(service: Service, given: str) -> None:
    answer = service.http.get("/livez", headers={"X-Request-Id": given})
    assert answer.headers["X-Request-Id"] != given and len(answer.headers["X-Request-Id"]) == 36


@pytest.fixture
def limited(settings: ServiceSettings) -> Iterator[str]:
    few = settings.model_copy(update={"rate_limit_per_s": 5})
    with serving(create_app(few)) as address:
        yield address


def test_too_many_requests_a_second_are_told_when_to_come_again(limited: str) -> None:
    with http_client(limited) as http:
        answers = [http.get("/v1/jobs") for _ in range(30)]
        refused = [each for each in answers if each.status_code == 429]
        assert refused and answers[0].status_code == 200
        assert refused[0].json()["code"] == "rate_limited" and refused[0].headers["Retry-After"] == "1"
        assert http.get("/livez").status_code == 200  # probes are not counted


def test_settings_are_shown_with_their_origin_and_without_passwords(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUSP_DATABASE_URL", "postgresql://me:secret@db/cusp")
    monkeypatch.setenv("CUSP_JOBS", "3")
    told = CliRunner().invoke(cli, ["config", "show", "--json"])
    assert told.exit_code == 0 and "secret" not in told.output
    rows = {row["variable"]: row for row in json.loads(told.stdout)}
    assert set(rows) == {f"CUSP_{name.upper()}" for name in ServiceSettings.model_fields}
    assert len(rows) < 40
    assert (rows["CUSP_JOBS"]["value"], rows["CUSP_JOBS"]["from"]) == (3, "environment")
    assert rows["CUSP_PORT"]["from"] == "default"
    assert rows["CUSP_DATABASE_URL"]["value"] == "postgresql+psycopg://me:***@db/cusp"
    assert "secret" not in CliRunner().invoke(cli, ["config", "show"]).output


@pytest.mark.parametrize(
    ("variable", "value"),
    [
        ("CUSP_DATABASE_URL", "mysql://x"),
        ("CUSP_BLOB_URL", "gs://bucket"),
        ("CUSP_BLOB_URL", "s3://"),
        ("CUSP_WEBHOOK_NETWORKS", "10.0.0.0/8, here"),
        ("CUSP_WORKER_ID", "a/b"),
    ],
)
def test_a_wrong_setting_is_named(monkeypatch: pytest.MonkeyPatch, variable: str, value: str) -> None:
    monkeypatch.setenv(variable, value)
    told = CliRunner().invoke(cli, ["config", "show"])
    assert told.exit_code == 1
    assert variable.removeprefix("CUSP_").lower() in told.output.lower()


def test_nobody_is_believed_to_be_somebody_else_unless_it_is_asked_for(
    settings: ServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("FORWARDED_ALLOW_IPS", raising=False)
    assert not configuration(settings).proxy_headers
    monkeypatch.setenv("FORWARDED_ALLOW_IPS", "10.0.0.7")
    trusting = configuration(settings)
    assert trusting.proxy_headers and trusting.forwarded_allow_ips == "10.0.0.7"
