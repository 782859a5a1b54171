"""Golden screens: the page looks as it did when somebody last looked at it.

Renew the pictures after a wanted change, and look at them:

    CUSP_GOLDEN=renew CUSP_TEST_NIGHTLY=1 .venv/bin/python -m pytest -m nightly tests/e2e/test_golden.py

A screen is compared at a quarter of its size in blocks, so that what letters look like on another machine
does not count, and a box that is gone does.
"""

import io
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, expect

from service.contract.schemas import Job
from tests.support.browser import Watched

pytestmark = [pytest.mark.e2e, pytest.mark.nightly, pytest.mark.timeout(600)]

GOLDEN = Path(__file__).parent / "golden"
SHRINK = 4  # of a stored picture
LARGEST_FILE = 40_000  # bytes
BLOCK = 5  # pixels of it: 20 of the screen
LARGEST = 24.0  # mean difference of a block, of 255: a line of text is 40 and more
#: Times, ids and durations.
CHANGING = "#job-made, #identity-list dd, #job-rows td:first-child, #how-figures dd"


def _list(page: Page) -> None:
    page.fill("#filter-name", "finished")
    page.locator("#filter-name").blur()
    expect(page.locator("#job-rows tr")).to_have_count(1)
    page.locator("#jobs").scroll_into_view_if_needed()


def _nothing(page: Page) -> None:
    pass


def _section(page: Page) -> None:
    page.click("#sides button:text-is('oblique')")
    page.click("#section summary")
    page.select_option("#section-axis", "y")
    page.fill("#section-mm", "0")
    page.select_option("#section-times", "50")
    page.check("#clip")
    page.evaluate("document.getElementById('viewer').scrollIntoView()")


def _segments(page: Page) -> None:
    page.click("#segments summary")
    expect(page.locator("#segment-note")).to_have_text("")
    page.check("#segments-colour")
    page.uncheck("#segment-list input[value='0']")
    page.evaluate("document.getElementById('viewer').scrollIntoView()")


def _limits(page: Page) -> None:
    page.click("#limits summary")
    page.select_option("#limit-kind", "sphere")
    for field, value in (("name", "boss"), ("place-1", "0, 0, 15"), ("upper", "0.2"), ("reach", "6")):
        page.fill(f"#limit-{field}", value)
    page.click("#limit-add")
    page.locator("#limit-add").blur()
    page.evaluate("document.getElementById('viewer').scrollIntoView()")


SCREENS: dict[str, tuple[str | None, Callable[[Page], object]]] = {
    "list": (None, _list),
    "first": ("registered", _nothing),
    "section": ("registered", _section),
    "segments": ("registered", _segments),
    "limits": ("registered", _limits),
    "landmarks": ("marked", _nothing),
}


def shrunk(page: Page) -> Image.Image:
    """The screen at a quarter of its size, without what changes from job to job."""
    page.mouse.move(0, 0)
    page.wait_for_timeout(300)  # the last frame is drawn
    page.eval_on_selector_all(CHANGING, "(all) => all.forEach((each) => { each.textContent = '-'; })")
    image = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return image.resize((image.width // SHRINK, image.height // SHRINK), Image.Resampling.BOX)


def largest_difference(image: Image.Image, other: Image.Image) -> float:
    """Mean difference of the block that differs most."""
    a, b = (np.asarray(each.convert("RGB"), dtype=np.float64) for each in (image, other))
    assert a.shape == b.shape
    away = np.abs(a - b).max(axis=2)
    height, width = (size // BLOCK for size in away.shape)
    blocks = away[: height * BLOCK, : width * BLOCK].reshape(height, BLOCK, width, BLOCK)
    return float(blocks.mean(axis=(1, 3)).max())


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("name", SCREENS)
def test_a_screen_looks_as_before(
    watched: Watched, registered: Job, marked: Job, name: str, theme: str
) -> None:
    page = watched.page
    if page.locator("html").get_attribute("data-theme") != theme:
        page.click("#theme")
    of, act = SCREENS[name]
    if of is not None:
        watched.open({"registered": registered, "marked": marked}[of])
    act(page)
    image = shrunk(page)
    path = GOLDEN / f"{name}-{theme}.png"
    if os.environ.get("CUSP_GOLDEN") == "renew":
        image.save(path, optimize=True)
    assert path.stat().st_size < LARGEST_FILE
    golden = Image.open(path)
    assert largest_difference(image, golden) < LARGEST


@pytest.mark.parametrize("gone", ["#overlay", "#figures > div:nth-child(2) dd", "#fit", "#scale", "#status"])
def test_a_screen_without_something_is_noticed(watched: Watched, registered: Job, gone: str) -> None:
    page = watched.open(registered)
    before = shrunk(page)
    page.locator(gone).evaluate("(each) => { each.style.visibility = 'hidden'; }")
    assert largest_difference(shrunk(page), before) > LARGEST
