"""The page in a real browser: two files in, a coloured part out, and what a person does with it."""

import io
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from PIL import Image
from playwright.sync_api import Browser, Page, expect, sync_playwright

from tests.e2e.running import RunningService

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(300)]
CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"),
]
JOB_MS = 120_000


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed (apt-get install chromium)")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield opened
        opened.close()


class Watched:
    """A page, what it complained of, and where it asked."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.hosts: set[str] = set()
        page.on("console", lambda told: self.complaints.append(told.text) if told.type == "error" else None)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda asked: self.hosts.add(asked.url.split("/")[2]) if "://" in asked.url else None)


@pytest.fixture
def watched(browser: Browser, running: RunningService) -> Iterator[Watched]:
    context = browser.new_context(viewport={"width": 1100, "height": 900}, reduced_motion="reduce")
    made = Watched(context.new_page())
    made.page.goto(running.client.server)
    yield made
    context.close()
    assert made.hosts <= {running.client.server.split("//")[1]}, "a request left the machine"


def submit(page: Page, design: Path, scan: Path, *, label: str) -> None:
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", scan)
    page.fill("input[name=tolerance_mm]", "0.05")
    page.fill("input[name=label]", label)
    page.click("button.main")
    expect(page.locator("#result")).to_be_visible(timeout=JOB_MS)
    expect(page.locator("#ticks span")).to_have_count(5)  # drawn and coloured


def pixels(page: Page) -> np.ndarray:
    shot = page.locator("#canvas").screenshot()
    return np.asarray(Image.open(io.BytesIO(shot)).convert("RGB"), dtype=np.float64)


def coloured(image: np.ndarray) -> float:
    """Share of pixels that are clearly blue or red."""
    return float((np.abs(image[..., 0] - image[..., 2]) > 40).mean())


def test_two_files_become_a_coloured_part(watched: Watched, design: Path, scan: Path) -> None:
    page = watched.page
    submit(page, design, scan, label="seen in a browser")
    expect(page.locator("#status")).to_have_text("ok")
    expect(page.locator("#job-title")).to_contain_text("seen in a browser")
    first = pixels(page)
    drawn = (np.abs(first - first[2, 2]).max(axis=2) > 8).mean()
    assert 0.03 < drawn < 0.9  # there is a part, and air around it
    assert coloured(first) > 0.001

    slider = page.locator("#tolerance")
    most = float(slider.get_attribute("max") or "0")
    slider.fill(str(most))
    expect(page.locator("#within")).to_contain_text("% of the shown vertices")
    assert coloured(pixels(page)) < coloured(first) / 4  # all within: neutral, at once
    slider.fill("0")
    expect(page.locator("#tolerance-mm")).to_have_text("none")
    assert coloured(pixels(page)) > coloured(first)

    before = pixels(page)
    page.check("#show-landmarks")
    assert np.abs(pixels(page) - before).max() > 50
    page.check("#show-matches")
    page.check("#show-design")
    page.uncheck("#show-design")
    page.select_option("#pose", "before")
    moved = pixels(page)
    assert (np.abs(moved - before).max(axis=2) > 30).mean() > 0.02  # the scan lies where it was uploaded
    page.select_option("#pose", "final")
    for side in ("-z", "+x", "oblique"):
        page.select_option("#side", side)
    page.locator("#canvas").focus()
    page.keyboard.press("+")
    assert watched.complaints == []

    listed = page.locator("#files a").all_inner_texts()
    assert {"results.json", "report.html", "deviation.ply"} <= set(listed)
    with page.expect_popup() as opened:
        page.click("#files a:text('report.html')")
    expect(opened.value.locator("h1")).to_have_text("Registration of a scan to its design")
    page.goto(page.url.split("#")[0])
    expect(page.locator("#job-rows")).to_contain_text("seen in a browser")
    page.fill("#filter-label", "another")
    page.locator("#filter-label").blur()
    expect(page.locator("#job-rows tr")).to_have_count(0)


def test_a_landmark_says_what_it_is_under_the_pointer(watched: Watched, design: Path, scan: Path) -> None:
    page = watched.page
    submit(page, design, scan, label="hover")
    page.check("#show-landmarks")
    without = pixels(page)
    page.uncheck("#show-landmarks")
    found = np.argwhere(np.abs(pixels(page) - without).max(axis=2) > 50)
    page.check("#show-landmarks")
    box = page.locator("#canvas").bounding_box()
    assert box is not None and len(found)
    for y, x in found[:: max(1, len(found) // 30)]:
        page.mouse.move(box["x"] + float(x), box["y"] + float(y))
        if page.locator("#tip").is_visible():
            break
    expect(page.locator("#tip")).to_contain_text("T²")
    assert watched.complaints == []


def test_a_bad_file_is_refused_with_its_reason(watched: Watched, design: Path, tmp_path: Path) -> None:
    page = watched.page
    (tmp_path / "letter.stl").write_text("Dear Sir or Madam")
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", tmp_path / "letter.stl")
    page.click("button.main")
    expect(page.locator("#refused")).to_contain_text("scan: ")
    expect(page.locator("#refused")).to_have_attribute("role", "alert")
    assert page.url.split("#")[-1] == page.url  # still here
    assert all("415" in words for words in watched.complaints)  # the browser's own line about the answer


def test_a_job_that_fails_says_why(watched: Watched, design: Path, tmp_path: Path) -> None:
    page = watched.page
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", tmp_path / "flat.obj")
    page.click("button.main")
    expect(page.locator("#failed")).to_contain_text("scan: ", timeout=JOB_MS)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_axe_finds_nothing_serious(watched: Watched, design: Path, scan: Path, theme: str) -> None:
    page = watched.page
    if page.locator("html").get_attribute("data-theme") != theme:
        page.click("#theme")
    for is_result in (False, True):
        if is_result:
            submit(page, design, scan, label="axe")
        found = Axe().run(page).response["violations"]
        serious = [
            (each["id"], each["nodes"][0]["html"]) for each in found if each["impact"] in ("serious", "critical")
        ]
        assert serious == [], serious


def test_the_page_lets_nothing_else_in(running: RunningService) -> None:
    import httpx

    with httpx.Client(base_url=running.client.server) as http:
        for path in ("/", "/web/app.js", "/web/vendor/three/three.core.js"):
            answer = http.get(path)
            assert answer.status_code == 200
            policy = answer.headers["Content-Security-Policy"]
            assert "default-src 'none'" in policy and "script-src 'self'" in policy and "unsafe" not in policy
        assert http.get("/web/../settings.py").status_code == 404
        assert http.get("/web/%2e%2e/settings.py").status_code == 404
        assert "<script>" not in http.get("/").text and "style=" not in http.get("/").text
