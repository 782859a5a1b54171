"""A page of the service in Chromium, and what tests do with it as a person would."""

import io
import shutil
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import BrowserContext, Page, Route, expect

from service.contract.schemas import Job
from tests.support.running import RunningService
from tests.support.settings import FAST

CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"),
]
JOB_MS = 240_000
TOLERANCE_MM = 0.05
FINGER_PX = 44


class Watched:
    """A page, what it complained of, and where it asked."""

    def __init__(self, context: BrowserContext, server: str) -> None:
        self.page = context.new_page()
        self.server = server
        self.complaints: list[str] = []
        self.hosts: set[str] = set()
        self.page.on(
            "console", lambda told: self.complaints.append(told.text) if told.type == "error" else None
        )
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on(
            "request", lambda asked: self.hosts.add(asked.url.split("/")[2]) if "://" in asked.url else None
        )
        self.page.goto(server)

    def open(self, job: Job) -> Page:
        """The page of a finished job, all of it there."""
        self.page.goto(f"{self.server}/#{job.id}")
        expect(self.page.locator(f'#result[data-shown="{job.id}"]')).to_be_visible(timeout=30_000)
        return self.page


def finished(page: Page) -> str:
    """Wait until the job of the page is shown; its id."""
    expect(page.locator("#result[data-shown]")).to_be_visible(timeout=JOB_MS)
    return page.url.split("#")[1]


def pixels(page: Page) -> np.ndarray:
    shot = page.locator("#canvas").screenshot()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), dtype=np.float64)


def coloured(image: np.ndarray) -> float:
    """Share of pixels that are clearly blue or red."""
    return float((np.abs(image[..., 0] - image[..., 2]) > 40).mean())


def changed(image: np.ndarray, other: np.ndarray) -> float:
    """Share of pixels that differ."""
    return float((np.abs(image - other).max(axis=2) > 30).mean())


def hover_over(page: Page, y: float, x: float) -> str:
    """What the page says of a pixel of the canvas."""
    box = page.locator("#canvas").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + x, box["y"] + y)
    page.wait_for_timeout(250)
    return page.locator("#tip").inner_text() if page.locator("#tip").is_visible() else ""


def drag(page: Page, selector: str, by: tuple[float, float]) -> None:
    box = page.locator(selector).bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + by[0], y + by[1], steps=4)
    page.mouse.up()


def results(running: RunningService, job_id: str) -> dict[str, Any]:
    found: dict[str, Any] = running.client.results(job_id)
    return found


def rewritten(page: Page, change: Any) -> None:
    """The results of jobs, changed on their way to the page."""

    def answer(route: Route) -> None:
        fetched = route.fetch()
        document = fetched.json()
        change(document)
        route.fulfill(response=fetched, json=document)

    page.route("**/results", answer)


QUICKLY = """(settings) => {
  const append = FormData.prototype.append;
  FormData.prototype.append = function (name, value, ...more) {
    const sent = name === 'options' ? JSON.stringify({ ...JSON.parse(value), settings }) : value;
    return append.call(this, name, sent, ...more);
  };
}"""


def quickly(page: Page) -> None:
    """Jobs that the form starts with files take the settings of `FAST`, which the page does not offer."""
    page.evaluate(QUICKLY, FAST)
