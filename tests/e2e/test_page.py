"""The page in a real browser: two files in, a coloured part out, and what a person does with it."""

import io
import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import trimesh
from axe_playwright_python.sync_playwright import Axe
from PIL import Image
from playwright.sync_api import Browser, BrowserContext, Page, expect, sync_playwright

from service.auth.keys import KeyStore, Scope
from service.contract.schemas import Job
from service.settings import ServiceSettings
from service.storage.database import open_database
from tests.support.running import LONG, QUICK, RunningService

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]
CHROMIUM = shutil.which("chromium")
ARGUMENTS = [
    *("--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--disable-quic"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"),
]
JOB_MS = 240_000
TOLERANCE_MM = 0.05
FINGER_PX = 44


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed (apt-get install chromium)")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield opened
        opened.close()


@pytest.fixture(scope="module")
def registered(running: RunningService, design: Path, scan: Path) -> Job:
    """A finished registration, for the tests that only look."""
    options = {**QUICK, "label": "finished", "tolerance_mm": TOLERANCE_MM}
    return running.successful(running.client.submit(design, scan, options).id)


@pytest.fixture(scope="module")
def symmetric(running: RunningService, tmp_path_factory: pytest.TempPathFactory) -> Job:
    """A brick on itself: it fits in four ways."""
    brick = trimesh.creation.box(extents=(30.0, 20.0, 10.0))
    for _ in range(3):
        brick = brick.subdivide()
    path = tmp_path_factory.mktemp("brick") / "brick.stl"
    brick.export(path)
    return running.successful(running.client.submit(path, path, {**QUICK, "label": "brick"}).id)


@pytest.fixture(scope="module")
def marked(running: RunningService, design: Path) -> Job:
    """A finished landmarks job."""
    given = {"type": "landmarks", "options": json.dumps(QUICK)}
    files = {"mesh": ("part.stl", design.read_bytes())}
    answer = httpx.post(f"{running.client.server}/v1/jobs", data=given, files=files)
    return running.successful(answer.json()["id"])


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


@pytest.fixture
def watched(browser: Browser, running: RunningService) -> Iterator[Watched]:
    context = browser.new_context(viewport={"width": 1100, "height": 900}, reduced_motion="reduce")
    made = Watched(context, running.client.server)
    yield made
    context.close()
    assert made.hosts <= {running.client.server.split("//")[1]}, "a request left the machine"
    assert made.complaints == []


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


def test_two_files_become_a_coloured_part(watched: Watched, design: Path, scan: Path) -> None:
    page = watched.page
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", scan)
    page.fill("input[name=tolerance_mm]", str(TOLERANCE_MM))
    page.fill("input[name=label]", "seen in a browser")
    page.click("#go")
    expect(page.locator("#stages li")).to_have_count(11)  # it tells how far it is
    job_id = finished(page)
    expect(page.locator("#progress-box")).to_be_hidden()
    expect(page.locator("#status")).to_have_text("ok")
    expect(page.locator("#job-title")).to_contain_text("seen in a browser")
    expect(page.locator("#job-made")).to_contain_text("design.stl ← scan.stl")
    image = pixels(page)
    drawn = (np.abs(image - image[2, 2]).max(axis=2) > 8).mean()
    assert 0.03 < drawn < 0.9  # there is a part, and air around it
    assert coloured(image) > 0.001

    listed = page.locator("#files a").all_inner_texts()
    assert {"results.json", "report.html", "deviation.ply"} <= set(listed)
    with page.expect_popup() as opened:
        page.click("#files a:text('report.html')")
    expect(opened.value.locator("h1")).to_have_text("Registration of a scan to its design")
    page.click("a.button:text('All jobs')")
    row = page.locator("#job-rows tr", has_text="seen in a browser")
    expect(row).to_contain_text("successful")
    expect(row.locator("a")).to_have_attribute("href", f"#{job_id}")
    page.fill("#filter-label", "another")
    page.locator("#filter-label").blur()
    expect(page.locator("#job-rows tr")).to_have_count(0)
    expect(page.locator("#no-jobs")).to_be_visible()


def test_the_tolerance_recolours_at_once(watched: Watched, registered: Job, running: RunningService) -> None:
    page = watched.open(registered)
    first = pixels(page)
    found = results(running, registered.id)["deviation"]
    expect(page.locator("#within")).to_contain_text(f"{100 * found['within']:.1f} % of the area lies within")
    slider = page.locator("#tolerance")
    slider.fill(slider.get_attribute("max") or "")
    expect(page.locator("#within")).to_contain_text(re.compile(r"(9\d\.\d|100\.0) % of the area lies within"))
    assert coloured(pixels(page)) < coloured(first) / 4  # all within: neutral
    page.fill("#tolerance-mm", "0")
    expect(page.locator("#within")).not_to_contain_text("%")
    assert coloured(pixels(page)) > coloured(first)
    page.fill(
        "#tolerance-mm", str(found["tolerance_mm"] * 1.000001)
    )  # by the surface that is shown, not by the results
    share = float(page.locator("#within").inner_text().split(" %")[0])
    assert share == pytest.approx(100 * found["within"], abs=0.2)


def test_what_is_shown_is_chosen(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    plain = pixels(page)
    for box, least in (("#show-landmarks", 0.0005), ("#show-matches", 0.0005), ("#show-design", 0.02)):
        page.check(box)
        assert changed(pixels(page), plain) > least, box
        page.uncheck(box)
        assert changed(pixels(page), plain) == 0.0, box
    page.uncheck("#show-scan")
    assert changed(pixels(page), plain) > 0.02  # nothing is left
    page.check("#show-scan")
    page.click("#before")
    expect(page.locator("#pose")).to_have_value("before")
    moved = pixels(page)
    assert changed(moved, plain) > 0.02  # the scan lies where it was uploaded, beside its design
    page.click("#before")
    expect(page.locator("#pose")).to_have_value("final")
    assert changed(pixels(page), plain) < 0.002
    for side in ("-z", "+x", "oblique"):
        page.select_option("#side", side)
        assert changed(pixels(page), plain) > 0.005, side


def test_alternatives_are_shown(watched: Watched, symmetric: Job) -> None:
    page = watched.open(symmetric)
    offered = page.locator("#pose option").all_inner_texts()
    assert sum(text.startswith("symmetry") for text in offered) == 3
    page.select_option("#side", "oblique")
    page.check("#show-landmarks")
    final = pixels(page)
    page.select_option("#pose", "0")
    expect(page.locator("#pose-note")).to_contain_text("final pose")
    assert changed(pixels(page), final) > 0.0


def test_the_pointer_asks_landmarks_and_surfaces(
    watched: Watched, registered: Job, running: RunningService
) -> None:
    page = watched.open(registered)
    without = pixels(page)
    found = results(running, registered.id)
    height, width = without.shape[:2]
    said = hover_over(page, height / 2, width / 2)
    told = re.fullmatch(r"scan: segment (\d+)(?: \(halo\))?, T² [\d.e+]+, deviation (.)([\d.]+) mm", said)
    assert told, said
    assert int(told[1]) < found["segments"]["scan"]["count"]
    value = float(told[3]) * (1 if told[2] == "+" else -1)
    assert found["deviation"]["min_mm"] - 0.001 <= value <= found["deviation"]["max_mm"] + 0.001
    assert hover_over(page, 4, 4) == ""  # air
    page.check("#show-landmarks")
    marks = np.argwhere(np.abs(pixels(page) - without).max(axis=2) > 50)
    assert len(marks)
    for y, x in marks[:: max(1, len(marks) // 20)]:
        said = hover_over(page, float(y), float(x))
        if said.startswith("landmark"):
            break
    told = re.match(r"landmark (\d+) of the (design|scan): segment (\d+), T² ([\d.e+]+), deviation ", said)
    assert told, said
    landmark = next(each for each in found["landmarks"][told[2]] if each["id"] == int(told[1]))
    assert (landmark["segment"], landmark["t2"]) == (int(told[3]), pytest.approx(float(told[4]), rel=1e-3))


@pytest.mark.nightly
def test_centres_are_chosen_in_the_decision_graph(
    watched: Watched, registered: Job, running: RunningService
) -> None:
    page = watched.open(registered)
    before = results(running, registered.id)
    centres = before["segments"]["design"]["centres"]
    expect(page.locator("#plot .centre")).to_have_count(len(centres))
    expect(page.locator("#would")).to_contain_text(f"now {len(centres)} on the design")

    disc = page.locator("#plot .centre[data-segment='0']").bounding_box()
    assert disc is not None
    page.mouse.move(disc["x"] + disc["width"] / 2, disc["y"] + disc["height"] / 2)
    expect(page.locator("#graph-tip")).to_contain_text("centre of segment 0")
    page.mouse.move(2, 2)
    plain = pixels(page)
    page.mouse.click(disc["x"] + disc["width"] / 2, disc["y"] + disc["height"] / 2)
    assert changed(pixels(page), plain) > 0.0003  # a ring on the part

    page.evaluate(
        "document.querySelector('#rho-min').value = 0; document.querySelector('#delta-min').value = 0.001"
    )
    page.locator("#n-centres").focus()
    page.keyboard.press("Shift+Tab")
    page.keyboard.press("ArrowUp")  # any input begins the choice
    many = int(re.findall(r"\d+", page.locator("#would").inner_text())[0])
    assert many > 50
    drag(page, "#plot .grip.both", (60, -140))
    few = int(re.findall(r"\d+", page.locator("#would").inner_text())[0])
    assert 1 <= few < many
    assert float(page.input_value("#delta-min")) > 0.01

    delta_min = round(1.02 * sorted(each["delta"] for each in centres)[-2], 3)  # between the two highest
    page.fill("#rho-min", "0")
    page.fill("#delta-min", str(delta_min))
    expect(page.locator("#rerun input[value=box]")).to_be_checked()
    would = int(re.findall(r"\d+", page.locator("#would").inner_text())[0])
    page.click("#again")
    page.wait_for_url(lambda url: registered.id not in url)
    expect(page.locator("#job-title")).to_contain_text("finished")
    again = finished(page)
    after = results(running, again)
    asked = after["provenance"]["settings"]
    assert (asked["segmentation"]["rho_min"], asked["segmentation"]["delta_min_mm"]) == (0, delta_min)
    was = before["provenance"]["settings"]
    assert {**asked, "segmentation": None} == {**was, "segmentation": None}
    assert after["provenance"]["inputs"] == before["provenance"]["inputs"]
    assert after["deviation"]["tolerance_mm"] == TOLERANCE_MM
    assert running.client.job(again).inputs == registered.inputs
    assert (
        after["segments"]["design"]["count"] >= would
    )  # what the table of the file does not have may come to it
    assert after["segments"]["design"]["count"] != len(centres) or would == len(centres)
    expect(page.locator("#warnings")).to_contain_text("chosen by hand")
    expect(page.locator("#plot .centre")).to_have_count(after["segments"]["design"]["count"])
    expect(page.locator("#delta-min")).to_have_value(str(delta_min))


def test_meshes_that_were_sent_before_are_used_again(
    watched: Watched, registered: Job, running: RunningService, scan: Path, tmp_path: Path
) -> None:
    page = watched.open(registered)
    page.click("#new-again")
    expect(page.locator("#start-title")).to_be_focused()
    expect(page.locator(".slot[data-mesh=design] output")).to_contain_text("design.stl")
    expect(page.locator(".slot[data-mesh=scan] output")).to_contain_text("scan.stl")
    other = tmp_path / "another scan.stl"
    other.write_bytes(scan.read_bytes()[:-2] + b"\1\0")
    page.set_input_files("input[name=scan]", other)  # a file takes the place of what was chosen
    page.fill("input[name=label]", "again")
    with page.expect_request("**/v1/blobs*") as sent:
        page.click("#go")
    assert sent.value.method == "PUT"
    page.wait_for_selector("#job:not([hidden])")
    job = running.client.job(page.url.split("#")[1])
    assert job.inputs.design == registered.inputs.design
    assert job.inputs.scan is not None and registered.inputs.scan is not None
    assert job.inputs.scan.filename == "another scan.stl"
    assert job.inputs.scan.blob != registered.inputs.scan.blob
    page.click("#cancel")
    expect(page.locator("#failed")).to_contain_text("dismissed", timeout=JOB_MS)


def test_one_mesh_becomes_segments_and_landmarks(
    watched: Watched, design: Path, running: RunningService
) -> None:
    page = watched.page
    page.check("input[value=landmarks]")
    expect(page.locator(".slot[data-mesh=design]")).to_be_hidden()
    page.set_input_files("input[name=mesh]", design)
    page.click("#go")
    found = results(running, finished(page))
    assert found["type"] == "landmarks"
    expect(page.locator("#figures")).to_contain_text(str(len(found["landmarks"]["mesh"])))
    image = pixels(page)
    hues = {tuple(each) for each in (image[::4, ::4].reshape(-1, 3) // 64).astype(int)}
    assert len(hues) > 5  # segments in colours
    height, width = image.shape[:2]
    said = [hover_over(page, height * y, width * 0.5) for y in (0.4, 0.5, 0.6)]
    assert all(re.match(r"(mesh: segment|landmark)", each) and "T²" in each for each in said), said
    expect(page.locator("#plot .mark")).to_have_attribute("visibility", "visible")  # what the pointer is over
    page.uncheck("#show-landmarks")
    assert changed(pixels(page), image) > 0.0005
    expect(page.locator("#plot .centre")).to_have_count(found["segments"]["mesh"]["count"])


def test_a_study_is_shown(watched: Watched, design: Path, running: RunningService) -> None:
    options = (
        '{"study": {"trials": 20, "detectors": ["t2", "random"]}, '
        '"settings": {"resample": {"target_vertices": 400}}}'
    )
    files = {"mesh": ("part.stl", design.read_bytes())}
    given = {"type": "study", "options": options}
    job = running.successful(
        httpx.post(f"{running.client.server}/v1/jobs", data=given, files=files).json()["id"]
    )
    page = watched.open(job)
    found = results(running, job.id)
    expect(page.locator("#summary")).to_have_text(found["summary"])
    expect(page.locator("#study-table tbody tr")).to_have_count(len(found["informativeness"]))
    page.wait_for_function("document.querySelector('#study-picture').naturalWidth > 100")
    expect(page.locator("#viewer")).to_be_hidden()
    expect(page.locator("#graph")).to_be_hidden()


def test_a_running_job_is_watched_and_cancelled(
    watched: Watched, design: Path, running: RunningService
) -> None:
    job = running.client.submit(design, design, {**LONG, "label": "too long"})
    page = watched.page
    page.goto(f"{watched.server}/#{job.id}")
    expect(page.locator("#stages [aria-current=step]")).to_be_visible(timeout=JOB_MS)
    expect(page.locator("#stage")).to_have_attribute("role", "status")
    expect(page.locator("#job-title")).to_be_focused()
    page.goto(f"{watched.server}/#")
    expect(page.locator("#job-rows tr", has_text="too long")).to_contain_text("running")
    page.click("#job-rows tr:has-text('too long') a")
    page.click("#cancel")
    expect(page.locator("#failed")).to_contain_text("dismissed")
    assert running.client.job(job.id).status == "dismissed"
    page.on("dialog", lambda dialog: dialog.accept())
    page.click("#remove")
    expect(page.locator("#jobs")).to_be_visible()
    expect(page.locator("#job-rows")).not_to_contain_text("too long")


def test_a_bad_file_is_refused_with_its_reason(watched: Watched, design: Path, tmp_path: Path) -> None:
    page = watched.page
    page.click("#go")
    expect(page.locator("#refused")).to_contain_text("design: choose a file")
    expect(page.locator("input[name=design]")).to_be_focused()
    (tmp_path / "letter.stl").write_text("Dear Sir or Madam")
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", tmp_path / "letter.stl")
    page.click("#go")
    expect(page.locator("#refused")).to_contain_text("scan: ")
    expect(page.locator("#refused")).to_contain_text("unknown_format")
    expect(page.locator("#refused")).to_have_attribute("role", "alert")
    assert "#" not in page.url  # still here
    assert watched.complaints and all(
        "415" in words for words in watched.complaints
    )  # the browser's own line
    watched.complaints.clear()


def test_a_job_that_fails_says_why(watched: Watched, design: Path, tmp_path: Path) -> None:
    page = watched.page
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", tmp_path / "flat.obj")
    page.click("#go")
    expect(page.locator("#failed")).to_contain_text("scan: ", timeout=JOB_MS)
    expect(page.locator("#new-again")).to_be_visible()


@pytest.mark.parametrize("theme", ["light", pytest.param("dark", marks=pytest.mark.nightly)])
def test_axe_finds_nothing_serious(watched: Watched, registered: Job, marked: Job, theme: str) -> None:
    page = watched.page
    if page.locator("html").get_attribute("data-theme") != theme:
        page.click("#theme")
    for job in (None, registered, marked):
        if job is not None:
            watched.open(job)
            page.eval_on_selector_all(
                "#result details", "all => all.forEach((each) => { each.open = true; })"
            )
        found = Axe().run(page).response["violations"]
        serious = [
            (each["id"], each["nodes"][0]["html"])
            for each in found
            if each["impact"] in ("serious", "critical")
        ]
        assert serious == [], serious


@pytest.mark.nightly
def test_the_keyboard_alone_will_do(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    before = pixels(page)
    reached: set[str] = set()
    for _ in range(60):
        page.keyboard.press("Tab")
        name = page.evaluate("document.activeElement.id")
        if name == "canvas":
            page.keyboard.press("ArrowLeft")
            page.keyboard.press("+")
        if name:
            reached.add(name)
    assert {
        "side",
        "pose",
        "before",
        "show-design",
        "canvas",
        "tolerance",
        "tolerance-mm",
        "rho-min",
        "again",
    } <= reached
    assert changed(pixels(page), before) > 0.01  # turned and nearer
    page.locator("#centres-title").press("Enter")
    page.locator("#centres button").first.press("Enter")
    expect(page.locator("#plot .mark")).to_have_attribute("visibility", "visible")


@pytest.mark.nightly
def test_a_tablet_has_room_for_fingers(browser: Browser, running: RunningService, registered: Job) -> None:
    context = browser.new_context(
        viewport={"width": 820, "height": 1180}, has_touch=True, reduced_motion="reduce"
    )
    watched = Watched(context, running.client.server)
    page = watched.page
    for job in (None, registered):
        if job is not None:
            watched.open(job)
        assert page.evaluate("document.documentElement.scrollWidth") <= 820
        small = page.evaluate(
            """(least) => {
                const ticked = 'input[type=radio], input[type=checkbox]';
                const all = `button, select, input, summary, a, label:has(${ticked})`
                return [...document.querySelectorAll(all)]
                    .filter((each) => each.offsetParent && !each.matches(ticked))
                    .filter((each) => each.getBoundingClientRect().height < least - 0.5)
                    .map((each) => each.outerHTML.slice(0, 80));
            }""",
            FINGER_PX,
        )
        assert small == []
    box = page.locator("#canvas").bounding_box()
    assert box is not None
    page.touchscreen.tap(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    expect(page.locator("#tip")).to_contain_text("deviation")  # there is no hover: a tap asks
    context.close()
    assert watched.complaints == []


def test_the_page_lets_nothing_else_in(running: RunningService) -> None:
    with httpx.Client(base_url=running.client.server) as http:
        for path in ("/", "/web/app.js", "/web/vendor/three/three.core.js"):
            answer = http.get(path)
            assert answer.status_code == 200
            policy = answer.headers["Content-Security-Policy"]
            assert "default-src 'none'" in policy and "script-src 'self'" in policy and "unsafe" not in policy
        assert http.get("/web/../settings.py").status_code == 404
        assert http.get("/web/%2e%2e/settings.py").status_code == 404
        assert "<script>" not in http.get("/").text and "style=" not in http.get("/").text


def test_a_key_opens_what_is_its_tenants(browser: Browser, tmp_path: Path, design: Path) -> None:
    service = RunningService(tmp_path / "keyed", CUSP_JOBS="1")
    try:
        engine = open_database(ServiceSettings(data_dir=tmp_path / "keyed").database)
        _, key = KeyStore(engine).create("acme", [Scope.READ, Scope.WRITE])
        engine.dispose()
        context = browser.new_context(viewport={"width": 1100, "height": 900})
        watched = Watched(context, service.client.server)
        page = watched.page
        expect(page.locator("#refused")).to_contain_text("API key")
        expect(page.locator("#key")).to_be_focused()
        page.keyboard.type(key)
        page.keyboard.press("Enter")
        expect(page.locator("#refused")).to_be_hidden()
        given = {"type": "landmarks", "options": json.dumps(QUICK)}
        files, asked = {"mesh": ("design.stl", design.read_bytes())}, {"Authorization": f"Bearer {key}"}
        job = httpx.post(f"{service.client.server}/v1/jobs", data=given, files=files, headers=asked).json()
        page.goto(f"{service.client.server}/#{job['id']}")
        finished(page)
        assert coloured(pixels(page)) > 0.01
        with page.expect_download() as kept:
            page.click("#files a:text('results.json')")
        assert json.loads(kept.value.path().read_text())["type"] == "landmarks"
        page.goto("about:blank")
        page.goto(f"{service.client.server}/#")
        expect(page.locator("#job-rows")).to_contain_text("design.stl")  # kept in the tab
        context.close()
        assert all("401" in words for words in watched.complaints)
    finally:
        service.stop()
