"""The pages of the service load nothing from other hosts: the origin holds the API key of the reader."""

import re

import pytest
from playwright.sync_api import expect, sync_playwright

from service.api.routes.page import POLICY, WEB
from tests.support.browser import ARGUMENTS, CHROMIUM, Watched
from tests.support.service import Service

PAGES = ("/", "/docs")
LOADED = re.compile(r"""(?:src|href)\s*=\s*["']([^"']+)""")


@pytest.mark.parametrize("page", PAGES)
def test_a_page_names_no_other_host(service: Service, page: str) -> None:
    answer = service.http.get(page)
    assert answer.headers["content-security-policy"] == POLICY
    places = LOADED.findall(answer.text)
    assert len(places) >= 3
    for place in places:
        assert not place.startswith(("http:", "https:", "//")), place
        if place.startswith("/"):
            loaded = service.http.get(place)
            assert loaded.status_code == 200, place
            if place.startswith("/web/"):
                assert loaded.headers["content-security-policy"] == POLICY


def test_what_is_vendored_has_its_licence() -> None:
    for folder in (WEB / "vendor").iterdir():
        assert (folder / "LICENSE").is_file() and (folder / "README.md").is_file(), folder


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium is installed")
def test_no_page_asks_another_host(service: Service) -> None:
    server = str(service.http.base_url).rstrip("/")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        watched = Watched(browser.new_context(), server)
        for page in PAGES:
            watched.page.goto(server + page)
            watched.page.wait_for_load_state("networkidle")
        expect(watched.page.get_by_text("/v1/jobs", exact=True).first).to_be_visible()
        watched.page.locator(".opblock-post .opblock-summary").first.click()  # an operation, with its form
        expect(watched.page.locator(".opblock-body").first).to_be_visible()
        assert watched.hosts == {server.removeprefix("http://")}
        assert watched.complaints == []
        browser.close()
