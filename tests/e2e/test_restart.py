"""Nothing is lost: however the service ends, its jobs finish after the next start. And
who may see them.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from service.auth.keys import KeyStore, Scope
from service.jobs.models import DEFAULT_TENANT
from service.settings import ServiceSettings
from service.storage.database import open_database
from tests.support.browser import Watched, coloured, finished, pixels
from tests.support.running import QUICK, RunningService

pytestmark = pytest.mark.e2e

SLOWER = {"settings": {**QUICK["settings"], "resample": {"target_vertices": 2000}}}


@dataclass(frozen=True)
class Restarted:
    """A service that was killed with two jobs, and started again."""

    service: RunningService
    interrupted: str
    waiting: str


@pytest.fixture(scope="module")
def restarted(tmp_path_factory: pytest.TempPathFactory, design: Path, scan: Path) -> Iterator[Restarted]:
    data_dir = tmp_path_factory.mktemp("restarted") / "data"
    service = RunningService(data_dir, CUSP_JOBS="1")
    first, second = (service.client.submit(design, scan, options).id for options in (SLOWER, QUICK))
    service.running(first)
    service.kill_everything()
    service = RunningService(data_dir, CUSP_JOBS="1")
    yield Restarted(service, first, second)
    service.stop()


def test_jobs_survive_a_kill_of_everything(restarted: Restarted) -> None:
    service = restarted.service
    assert service.successful(restarted.interrupted).attempt == 2  # killed, finished
    assert service.successful(restarted.waiting).attempt == 1
    assert service.client.results(restarted.interrupted)["transform"] is not None


def test_a_key_opens_what_is_its_tenants(restarted: Restarted, browser: Browser) -> None:
    """After the first key the page asks for one; the last test here that may do without."""
    service = restarted.service
    service.successful(restarted.waiting)
    engine = open_database(ServiceSettings(data_dir=service.data_dir).database)
    keys = {tenant: KeyStore(engine).create(tenant, [Scope.READ])[1] for tenant in (DEFAULT_TENANT, "acme")}
    engine.dispose()
    context = browser.new_context(viewport={"width": 1100, "height": 900})
    watched = Watched(context, service.client.server)
    page = watched.page
    expect(page.locator("#refused")).to_contain_text("API key")
    expect(page.locator("#key")).to_be_focused()
    page.keyboard.type(keys["acme"])
    page.keyboard.press("Enter")
    expect(page.locator("#refused")).to_be_hidden()
    expect(page.locator("#no-jobs")).to_be_visible()  # those of another tenant are none of its own
    page.fill("#key", keys[DEFAULT_TENANT])
    page.keyboard.press("Enter")
    expect(page.locator("#job-rows tr")).to_have_count(2)
    page.goto(f"{service.client.server}/#{restarted.waiting}")
    finished(page)
    assert coloured(pixels(page)) > 0.01
    with page.expect_download() as kept:
        page.click("#files a:text('results.json')")
    assert json.loads(kept.value.path().read_text())["type"] == "registration"
    page.goto("about:blank")
    page.goto(f"{service.client.server}/#")
    expect(page.locator("#job-rows")).to_contain_text("design.stl")  # kept in the tab
    context.close()
    assert all("401" in words for words in watched.complaints)


@pytest.mark.nightly
def test_jobs_survive_a_clean_stop_and_a_kill_of_everything(tmp_path: Path, design: Path, scan: Path) -> None:
    data_dir = tmp_path / "data"
    service = RunningService(data_dir, CUSP_JOBS="1")
    first, second = (service.client.submit(design, scan, options).id for options in (SLOWER, QUICK))
    service.running(first)
    assert service.stop() < 10

    service = RunningService(data_dir, CUSP_JOBS="1")
    assert service.client.job(second).attempt == 0
    service.running(first)
    service.kill_everything()

    service = RunningService(data_dir, CUSP_JOBS="1")
    try:
        assert service.successful(first).attempt == 3  # stopped, killed, finished
        assert service.successful(second).attempt == 1
        assert service.client.results(first)["transform"] is not None
    finally:
        service.stop()
