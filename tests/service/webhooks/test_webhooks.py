"""Webhooks: every end of a job is told once it is committed, signed as receivers check it, again until it is
taken, and to no address that only we can reach.
"""

import json
import socket
import threading
import time
from typing import Any

import pytest
from sqlalchemy import Engine
from sqlalchemy.orm import Session
from standardwebhooks import Webhook, WebhookVerificationError
from typer.testing import CliRunner

from service.cli.main import app as cli
from service.contract.errors import JobCrashed, problem_of
from service.contract.schemas import DeliveryState
from service.jobs.deliveries import DeliveryRow, receiver_of
from service.jobs.models import new_id, now_ms
from service.jobs.store import JobStore
from service.webhooks.http_client import TOTAL_S, Poster
from service.webhooks.outbox import BACK_OFF_S, LEASE_MS, Answer, Deliveries
from service.webhooks.receivers import (
    FAILURES_TO_OPEN,
    FIRST_PAUSE_S,
    MAX_PER_RECEIVER,
    MAX_PER_TENANT,
    Receivers,
)
from service.webhooks.sender import Sender
from tests.support.receiver import Receiver, Trickle
from tests.support.service import Service, assert_problem

pytestmark = pytest.mark.storages


CLOCKS_MS = 100  # the service's clock is that of its database


def options(receiver: Receiver) -> str:
    return json.dumps({"webhook": {"url": receiver.url}, "label": "ä 7"})


def send_due(engine: Engine, poster: Poster, after_s: float = 0.0) -> list[DeliveryState]:
    """One round of a sender whose clock is ahead."""
    at = now_ms() + CLOCKS_MS + int(after_s * 1000)
    deliveries = Deliveries(engine, lambda: at)
    return [Sender(deliveries, poster).send(row) for row in deliveries.take(10)]


def deliveries_of(service: Service, job_id: str) -> list[dict[str, Any]]:
    listed: list[dict[str, Any]] = service.http.get(f"/v1/jobs/{job_id}/deliveries").json()["deliveries"]
    return listed


def test_a_successful_job_is_told_and_the_signature_is_right(
    service: Service, receiver: Receiver, engine: Engine, poster: Poster
) -> None:
    job_id = service.submitted(options(receiver))
    assert send_due(engine, poster) == [] and deliveries_of(service, job_id) == []
    service.worker.run(job_id)
    (waiting,) = deliveries_of(service, job_id)
    assert (waiting["state"], waiting["event"], waiting["attempts"]) == ("waiting", "job.successful", [])
    assert send_due(engine, poster) == [DeliveryState.DELIVERED]
    (headers, body) = receiver.got[0]
    (secret,) = Deliveries(engine).secrets("default")
    message = Webhook(secret).verify(body, headers)
    assert message["type"] == "job.successful" and message["data"] == service.status(job_id)
    with pytest.raises(WebhookVerificationError):
        Webhook(secret).verify(body + b" ", headers)
    (delivered,) = deliveries_of(service, job_id)
    assert (
        delivered["id"] == headers["webhook-id"]
        and delivered["state"] == "delivered"
        and delivered["next"] is None
    )
    assert [tried["status"] for tried in delivered["attempts"]] == [204]
    assert send_due(engine, poster, 1e6) == []  # once


def test_failed_and_dismissed_are_told_too(service: Service, receiver: Receiver, engine: Engine) -> None:
    failed, waiting, running = (service.submitted(options(receiver)) for _ in range(3))
    jobs = JobStore(engine)
    for each in (failed, running):
        assert jobs.claim(each, "w") is not None
    assert jobs.fail(failed, 1, problem_of(JobCrashed("it died")))
    for each in (waiting, running):
        assert service.http.delete(f"/v1/jobs/{each}").status_code == 204
    events = [
        [each["event"] for each in deliveries_of(service, job_id)] for job_id in (failed, waiting, running)
    ]
    assert events == [["job.failed"], ["job.dismissed"], ["job.dismissed"]]
    assert not jobs.succeed(running, 1, [])  # the worker comes too late: nothing more is told
    assert len(deliveries_of(service, running)) == 1


def test_who_does_not_take_it_is_asked_again_later_and_later(
    service: Service, receiver: Receiver, engine: Engine, poster: Poster
) -> None:
    job_id = service.finished(options(receiver))
    receiver.answers = [(500, {}), (503, {"Retry-After": "600"}), (302, {"Location": receiver.url})]
    after_s = 0.0
    assert send_due(engine, poster) == [DeliveryState.WAITING]
    assert send_due(engine, poster, BACK_OFF_S[0] - 1) == []
    after_s += BACK_OFF_S[0] + 1
    assert send_due(engine, poster, after_s) == [DeliveryState.WAITING]
    assert send_due(engine, poster, after_s + 590) == []  # as it asked
    after_s += 601
    assert send_due(engine, poster, after_s) == [DeliveryState.WAITING]  # redirects are not followed
    assert send_due(engine, poster, after_s + BACK_OFF_S[2] + 1) == [DeliveryState.DELIVERED]
    (message,) = deliveries_of(service, job_id)
    assert [tried["status"] for tried in message["attempts"]] == [500, 503, 302, 204]
    assert len({headers["webhook-id"] for headers, _ in receiver.got}) == 1
    assert len({body for _, body in receiver.got}) == 1


def test_one_that_never_takes_it_or_is_gone_is_given_up(
    service: Service, receiver: Receiver, engine: Engine, poster: Poster
) -> None:
    gone, never = service.finished(options(receiver)), service.finished(options(receiver))
    receiver.answers = [(410, {})]
    assert send_due(engine, poster) == [DeliveryState.GIVEN_UP, DeliveryState.DELIVERED]
    receiver.stop()
    never = service.finished(options(receiver))
    after_s, states = 0.0, []
    for wait_s in (0, *BACK_OFF_S):
        after_s += wait_s + 1
        states += send_due(engine, poster, after_s)
    assert states == [DeliveryState.WAITING] * len(BACK_OFF_S) + [DeliveryState.GIVEN_UP]
    assert deliveries_of(service, gone)[0]["state"] == "given_up"
    assert all(
        tried["status"] is None and tried["error"] for tried in deliveries_of(service, never)[0]["attempts"]
    )


def test_two_senders_do_not_send_the_same(service: Service, receiver: Receiver, engine: Engine) -> None:
    for _ in range(4):
        service.finished(options(receiver))
    both = Deliveries(engine), Deliveries(engine)
    taken: list[str] = []
    threads = [
        threading.Thread(target=lambda each=each: taken.extend(row.id for row in each.take(10)))
        for each in both
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(taken) == len(set(taken)) == 4
    at = now_ms() + LEASE_MS + 1  # both died: another takes them
    assert len(Deliveries(engine, lambda: at).take(10)) == 4


def test_a_running_sender_sends_within_a_second_or_two(
    service: Service, receiver: Receiver, engine: Engine, poster: Poster
) -> None:
    stop = threading.Event()
    thread = threading.Thread(target=Sender(Deliveries(engine), poster).run, args=(stop,))
    thread.start()
    job_id = service.finished(options(receiver))
    try:
        deadline = time.monotonic() + 20
        while not deliveries_of(service, job_id)[0]["attempts"]:
            assert time.monotonic() < deadline
            time.sleep(0.05)
    finally:
        stop.set()
        thread.join()
    assert len(receiver.got) == 1


def test_a_new_secret_signs_beside_the_old_for_a_day(
    service: Service, receiver: Receiver, engine: Engine, poster: Poster, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable, value in service.settings.environment().items():
        monkeypatch.setenv(variable, value)

    def run(*words: str) -> str:
        result = CliRunner().invoke(cli, ["webhooks", "secret", *words])
        assert result.exit_code == 0, result.output
        return result.stdout.strip()

    old = run()
    assert old == run() and old.startswith("whsec_")
    new = run("--rotate")
    assert new != old and run() == new
    service.finished(options(receiver))
    send_due(engine, poster)
    headers, body = receiver.got[0]
    for each in (old, new):
        assert Webhook(each).verify(body, headers)
    assert Deliveries(engine, lambda: now_ms() + 25 * 3_600_000).secrets("default") == [new]
    assert run("--tenant", "acme") != new


def test_a_receiver_that_answers_byte_by_byte_is_left(
    poster: Poster, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Or it would hold a sender for ever, and another would send the message again."""
    assert 1000 * TOTAL_S < LEASE_MS - 10_000
    monkeypatch.setattr("service.webhooks.http_client.TOTAL_S", 0.5)
    receiver = Trickle()
    answer = poster.post(receiver.url, {}, b"{}")
    receiver.thread.join(10)
    receiver.server.close()
    assert answer.status is None and answer.error in ("timed out", "no answer within 0.5 s")
    assert answer.seconds < 5


def test_of_several_addresses_the_first_that_takes_us_is_used(
    receiver: Receiver, poster: Poster, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = socket.getaddrinfo

    def looked_up(host: str, port: int, *positional: Any, **named: Any) -> list[Any]:
        if host != "two.example.org":
            return real(host, port, *positional, **named)
        return [
            (socket.AF_INET, socket.SOCK_STREAM, 6, "", (each, port)) for each in ("127.0.0.2", "127.0.0.1")
        ]

    monkeypatch.setattr("service.webhooks.http_client.socket.getaddrinfo", looked_up)
    answer = poster.post(receiver.url.replace("127.0.0.1", "two.example.org"), {}, b"{}")
    assert answer.status == 204 and len(receiver.got) == 1


# --- turns between receivers


class SlowFor(Poster):
    """A poster whose attempts at one receiver last until the test ends them; the others are accepted."""

    def __init__(self, slow: str) -> None:
        self._slow = slow
        self.posted: list[str] = []
        self.goes_on = threading.Event()

    def post(self, url: str, headers: Any, body: bytes) -> Answer:
        self.posted.append(url)
        if self._slow in url:
            self.goes_on.wait(60)
        return Answer(204, None, 0.0)


def store_messages(engine: Engine, urls: list[str], tenant: str = "default") -> None:
    with Session(engine) as session, session.begin():
        for number, url in enumerate(urls):
            session.add(
                DeliveryRow(
                    id=f"msg_{new_id()}",
                    job_id="job",
                    tenant=tenant,
                    url=url,
                    receiver=receiver_of(url),
                    event="job.failed",
                    body="{}",
                    state="waiting",
                    next_ms=number,
                    created_ms=0,
                    attempts=[],
                )
            )


def test_one_slow_receiver_starves_no_other(engine: Engine) -> None:
    """Its messages are the oldest, and more than there are senders."""
    slow, fast = "https://slow.example/hook", "https://fast.example/hook"
    store_messages(engine, [f"{slow}/{number}" for number in range(40)] + [fast] * 20)
    poster, stop = SlowFor(slow), threading.Event()
    thread = threading.Thread(target=Sender(Deliveries(engine), poster).run, args=(stop,))
    thread.start()
    try:
        deadline = time.monotonic() + 30
        while poster.posted.count(fast) < 20:
            assert time.monotonic() < deadline, poster.posted
            time.sleep(0.02)
        assert len(poster.posted) == 20 + MAX_PER_RECEIVER
    finally:
        stop.set()
        poster.goes_on.set()
        thread.join()


def test_a_tenant_of_many_receivers_starves_no_other_tenant(engine: Engine) -> None:
    """A wildcard name has any number of receivers."""
    store_messages(engine, [f"https://{number}.slow.example/hook" for number in range(100)])
    store_messages(engine, ["https://fast.example/hook"] * 3, tenant="acme")
    deliveries = Deliveries(engine)
    assert [row.tenant for row in deliveries.take(8)].count("acme") == 3
    # a tenant whose receivers are all slow leaves a place
    poster, stop = SlowFor("slow.example"), threading.Event()
    thread = threading.Thread(target=Sender(deliveries, poster).run, args=(stop,))
    thread.start()
    try:
        deadline = time.monotonic() + 30
        while len(poster.posted) < MAX_PER_TENANT:
            assert time.monotonic() < deadline, poster.posted
            time.sleep(0.02)
        store_messages(engine, ["https://fast.example/late"], tenant="acme")
        while "https://fast.example/late" not in poster.posted:
            assert time.monotonic() < deadline, poster.posted
            time.sleep(0.02)
    finally:
        stop.set()
        poster.goes_on.set()
        thread.join()


def test_a_receiver_that_fails_is_left_alone_for_a_while() -> None:
    now = [0.0]
    receivers = Receivers(lambda: now[0])
    for _ in range(FAILURES_TO_OPEN):
        assert receivers.room("a") == MAX_PER_RECEIVER
        receivers.begin("a", "default")
        receivers.end("a", "default", is_failure=True)
    assert (receivers.room("a"), receivers.without_room()) == (0, ["a"])
    assert receivers.room("b") == MAX_PER_RECEIVER
    now[0] += FIRST_PAUSE_S
    assert receivers.room("a") == 1  # one is tried
    receivers.begin("a", "default")
    assert receivers.room("a") == 0
    receivers.end("a", "default", is_failure=True)
    now[0] += FIRST_PAUSE_S
    assert receivers.room("a") == 0  # the pause has doubled
    now[0] += FIRST_PAUSE_S
    receivers.begin("a", "default")
    receivers.end("a", "default", is_failure=False)
    assert (receivers.room("a"), receivers.without_room()) == (MAX_PER_RECEIVER, [])


def test_a_message_that_was_given_up_is_listed_and_sent_again(
    service: Service, receiver: Receiver, engine: Engine, poster: Poster
) -> None:
    job_id = service.finished(options(receiver))
    receiver.answers = [(410, {})]
    assert send_due(engine, poster) == [DeliveryState.GIVEN_UP]
    (listed,) = service.http.get("/v1/deliveries").json()["deliveries"]
    assert (listed["job"], listed["state"]) == (job_id, "given_up")
    again = service.http.post(f"/v1/jobs/{job_id}/deliveries/{listed['id']}/redeliver")
    assert (again.status_code, again.json()["state"], again.json()["attempts"]) == (202, "waiting", [])
    assert service.http.get("/v1/deliveries").json()["deliveries"] == []
    assert send_due(engine, poster) == [DeliveryState.DELIVERED]
    assert len({headers["webhook-id"] for headers, _ in receiver.got}) == 1
    unknown = service.http.post(f"/v1/jobs/{job_id}/deliveries/msg_7/redeliver")
    assert_problem(unknown, 404, "delivery_not_found", "msg_7")
