"""No webhook reaches an address that only we can reach."""

import json
import socket
from ipaddress import ip_address
from typing import Any

import pytest

from service.webhooks.address_guard import ForbiddenAddress, Guard
from service.webhooks.http_client import Poster
from tests.support.receiver import LOOPBACK, Receiver
from tests.support.service import Service


@pytest.mark.parametrize(
    "url",
    [
        "http://10.0.0.1/x",
        "http://192.168.0.1/",
        "http://169.254.169.254/latest/meta-data",
        "http://[::1]/",
        "http://[::ffff:10.0.0.1]/",
        "http://[64:ff9b::a00:1]/",
        "http://[2002:a00:1::]/",
        "http://[fec0::1]/",
        "http://[::7f00:1]/",
        "http://[64:ff9b:1::a00:1]/",
        "http://[::ffff:0:a00:1]/",
        "http://[fe80::1]/",
        "http://[fd00::1]/",
        "http://[ff02::1]/",
        "http://0.0.0.0/",
        "http://224.0.0.1/",
        "https://user:secret@example.org/",
        "ftp://example.org/",
        "file:///etc/passwd",
        "http:///x",
        "http://example.org:99999/",
        "http://exa mple.org/",
        "http://example.org/ä",
        "javascript:alert(1)",
        "",
    ],
)
def test_an_address_that_must_not_be_reached_is_refused_at_once(service: Service, url: str) -> None:
    answer = service.submit(json.dumps({"webhook": {"url": url}}))
    assert answer.status_code == 422
    assert (answer.json()["code"], answer.json()["errors"][0]["pointer"]) == (
        "invalid_options",
        "/options/webhook/url",
    )
    assert service.waiting == []


def test_loopback_is_refused_unless_it_is_allowed() -> None:
    names = [
        "127.0.0.1:1",
        "127.0.0.1.",
        "localhost:1",
        "localhost.",
        "LOCALHOST",
        "a.localhost",
        "a.localhost.",
    ]
    old_ways = ["127.1", "2130706433", "0x7f.1", "017700000001", "0x7f000001"]
    for url in (f"http://{host}/" for host in (*names, *old_ways)):
        with pytest.raises(ForbiddenAddress):
            Guard().check_url(url)
        Guard.of(LOOPBACK).check_url(url)


def test_a_name_that_leads_inside_is_refused_when_it_is_looked_up(
    receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The name is public at submission. The connection goes to the judged address: there is no second look-up
    to fool.
    """
    asked: list[str] = []

    def looked_up(host: str, port: int, **_: Any) -> list[Any]:
        asked.append(host)
        inside = "127.0.0.1" if len(asked) == 1 else "93.184.216.34"
        return [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (inside, port))]

    url = receiver.url.replace("127.0.0.1", "rebinding.example.org")
    Guard().check_url(url)
    monkeypatch.setattr("service.webhooks.http_client.socket.getaddrinfo", looked_up)
    poster = Poster(Guard())
    answer = poster.post(url, {}, b"{}")
    poster.close()
    assert answer.is_forbidden and not answer.is_accepted and receiver.got == []
    assert asked == ["rebinding.example.org"]


def test_an_open_address_is_not_refused() -> None:
    Guard().check("example.org", ip_address("93.184.216.34"))
    Guard().check("example.org", ip_address("2606:2800:220:1:248:1893:25c8:1946"))
    Guard().check(
        "example.org", ip_address("64:ff9b::5db8:d822")
    )  # the first one's, where there is only IPv6
    for url in ("https://example.org/", "http://93.184.216.34:8080/", "http://[2606:2800:220:1::1]/"):
        Guard().check_url(url)
    Guard.of("fd00::/8").check_url("http://[fd00::1]/")
