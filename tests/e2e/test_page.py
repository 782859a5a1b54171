"""The page in a real browser: two files in, a coloured part out, and what a person does with it."""

import re
from pathlib import Path

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Route, expect

from service.contract.schemas import Job
from tests.support.browser import (
    FINGER_PX,
    TOLERANCE_MM,
    Watched,
    changed,
    coloured,
    drag,
    finished,
    hover_over,
    pixels,
    quickly,
    results,
)
from tests.support.running import RunningService

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]


def test_two_files_become_a_coloured_part(watched: Watched, design: Path, scan: Path) -> None:
    page = watched.page
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", scan)
    page.fill("input[name=tolerance_mm]", str(TOLERANCE_MM))
    page.fill("input[name=scan_accuracy_mm]", "0.02")
    page.fill("input[name=min_within]", "10")
    page.fill("input[name=serial]", "A-17")
    page.fill("input[name=label]", "seen in a browser")
    quickly(page)
    page.click("#go")
    expect(page.locator("#stages li")).to_have_count(12)  # it tells how far it is
    job_id = finished(page)
    expect(page.locator("#progress-box")).to_be_hidden()
    expect(page.locator("#status")).to_have_text("alignment: ok")
    expect(page.locator("#decided")).to_have_text("part: pass")
    page.click("#checks summary")
    expect(page.locator("#check-table tbody tr")).to_contain_text("within")
    expect(page.locator("#how-figures div", has_text="scanner accuracy")).to_contain_text("0.02 mm")
    expect(page.locator("#identity-list")).to_contain_text("A-17")
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
    expect(opened.value.locator("h1")).to_have_text("Inspection report")
    for words in ("A-17", "design.stl", "scan.stl", job_id):  # which part, which files, which job
        expect(opened.value.locator(".facts")).to_contain_text(words)
    page.click("a.button:text('All jobs')")
    row = page.locator("#job-rows tr", has_text="seen in a browser")
    expect(row).to_contain_text("successful")
    expect(row.locator("td").last).to_have_text(re.compile(r"^(> )?\d+\.\d %$"))  # within the tolerance
    expect(row.locator("a")).to_have_attribute("href", f"#{job_id}")
    page.fill("#filter-name", "another")
    page.locator("#filter-name").blur()
    expect(page.locator("#job-rows tr")).to_have_count(0)
    page.fill("#filter-name", "")
    page.locator("#filter-name").blur()
    expect(row).to_contain_text("A-17")
    page.fill("#filter-name", "in a brow")  # a part of the name
    page.locator("#filter-name").blur()
    expect(page.locator("#job-rows tr")).to_have_count(1)
    page.fill("#filter-name", "")
    for day, count in (("2020-01-01", 0), ("2999-01-01", 1)):
        page.fill("#filter-serial", "A-17")
        page.fill("#filter-to", day)
        page.locator("#filter-to").blur()
        expect(page.locator("#job-rows tr")).to_have_count(count)
    page.fill("#filter-from", "2998-12-31")
    page.locator("#filter-from").blur()
    expect(page.locator("#job-rows tr")).to_have_count(0)
    for name in ("from", "to", "serial"):
        page.fill(f"#filter-{name}", "")
        page.locator(f"#filter-{name}").blur()
    page.select_option("#filter-decision", "pass")
    expect(row).to_contain_text("pass")
    page.select_option("#filter-decision", "fail")
    expect(page.locator("#job-rows tr")).to_have_count(0)
    expect(page.locator("#no-jobs")).to_be_visible()


def test_the_tolerance_recolours_at_once(watched: Watched, registered: Job, running: RunningService) -> None:
    page = watched.open(registered)
    page.uncheck("#show-pins")
    first = pixels(page)
    found = results(running, registered.id)["deviation"]
    expect(page.locator("#within")).to_contain_text(f"{100 * found['within']:.1f} % of the area lies within")
    slider = page.locator("#tolerance")
    slider.fill(slider.get_attribute("max") or "")  # the scale grows with it: its end is never neutral
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
    page.check("#show-design")
    veiled = pixels(page)
    assert np.abs(veiled - plain).mean() > 1.0
    red = [(image[..., 0] - image[..., 2] > 25).mean() for image in (veiled, plain)]
    assert red[0] > 0.3 * red[1] > 0.0  # a veil, through which the colours are seen
    page.uncheck("#show-scan")
    assert changed(pixels(page), veiled) > 0.02  # alone it is a body
    page.check("#show-scan")
    assert changed(pixels(page), veiled) == 0.0
    page.uncheck("#show-design")
    for box, least in (("#show-landmarks", 0.0005), ("#show-matches", 0.0005)):
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
    for side in ("\N{MINUS SIGN}z", "+x", "oblique"):
        page.click(f"#sides button:text-is('{side}')")
        assert changed(pixels(page), plain) > 0.005, side


def test_alternatives_are_shown(watched: Watched, symmetric: Job) -> None:
    page = watched.open(symmetric)
    offered = page.locator("#pose option").all_inner_texts()
    (text,) = [text for text in offered if text.startswith("equivalent")]  # one for all of them
    assert text.endswith("stands for 3 equivalent poses")
    page.click("#how > summary")
    page.click("#others-title")
    row = page.locator("#others-table tbody tr")
    expect(row).to_have_count(len(offered) - 2)
    expect(row.last).to_contain_text("symmetry of the design, stands for 3 equivalent poses")
    page.click("#sides button:text-is('oblique')")
    page.check("#show-landmarks")
    final = pixels(page)
    page.select_option("#pose", "0")
    expect(page.locator("#pose-note")).to_contain_text("final pose")
    assert changed(pixels(page), final) > 0.0


def test_why_shows_the_evidence_of_both_probabilities(
    watched: Watched, registered: Job, running: RunningService
) -> None:
    page = watched.open(registered)
    verdict = results(running, registered.id)["verdict"]
    expect(page.locator("#why-tables")).to_be_hidden()  # folded
    page.click("#how > summary")
    for number, of in enumerate(("same_part", "pose")):
        title = page.locator("#why-tables h3").nth(number)
        expect(title).to_contain_text(f"{of.replace('_', ' ')}: {verdict[of]:.2f}")
        table = page.locator("#why-tables table").nth(number)
        expected = [each for each in verdict["evidence"] if each["of"] == of]
        expect(table.locator("tbody tr")).to_have_count(len(expected))
        for row, each in zip(table.locator("tbody tr").all(), expected, strict=True):
            expect(row).to_contain_text(each["name"].replace("_", " "))
            expect(row).to_contain_text(each["detail"])


def test_the_verdict_is_of_the_alignment_whatever_it_is(watched: Watched, registered: Job) -> None:
    """Statuses that the meshes of these tests do not give, on results changed on their way to the page."""
    page = watched.page

    def changed_verdict(route: Route) -> None:
        answer = route.fetch()
        document = answer.json()
        document["verdict"] |= {"status": "uncertain", "confidence": None, "same_part": None, "pose": None}
        document["scan"] = None
        check = {"name": "rim: highest", "kind": "highest", "region": "rim", "value": 0.31, "lower": None}
        check |= {
            "upper": 0.2,
            "unit": "mm",
            "uncertainty": 0.01,
            "n": 20,
            "passed": False,
            "position_mm": None,
        }
        document["inspection"] |= {
            "decision": "fail",
            "reasons": ["too high"],
            "rule": "r",
            "checks": [check],
        }
        route.fulfill(response=answer, json=document)

    page.route("**/results", changed_verdict)
    watched.open(registered)
    expect(page.locator("#status")).to_have_text("alignment: uncertain")
    expect(page.locator("#verdict")).to_have_class("warn")
    expect(page.locator("#decided")).to_have_text("part: fail")
    expect(page.locator("#decision")).to_have_class("bad")
    expect(page.locator("#counts")).to_have_text("0 of 1 checks passed")
    expect(page.locator("#reasons")).to_have_text("too high")
    expect(page.locator("#check-table tbody tr")).to_contain_text("rim: highest")  # open: it failed
    expect(page.locator("#check-table tbody tr")).to_contain_text("+0.310 mm")
    expect(page.locator("#check-table tbody tr .bad")).to_have_text("failed")
    expect(page.locator("#meaning")).to_contain_text("it is not certain that the scan shows this part")
    expect(page.locator("#confidence")).to_have_text("confidence not given")
    expect(page.locator("#why-tables h3").first).to_contain_text("same part: not given")
    expect(page.locator("#how-figures")).not_to_contain_text("scanner accuracy")
    page.unroute("**/results")


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
    page.click("#how > summary")
    expect(page.locator("#plot .centre")).to_have_count(len(centres))
    expect(page.locator("#would")).to_contain_text(f"now {len(centres)} on the design")

    plain = pixels(page)
    page.locator("#plot").scroll_into_view_if_needed()  # the graph is below the part
    disc = page.locator("#plot .centre[data-segment='0']").bounding_box()
    assert disc is not None
    page.mouse.move(disc["x"] + disc["width"] / 2, disc["y"] + disc["height"] / 2)
    expect(page.locator("#graph-tip")).to_contain_text("centre of segment 0")
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
    page.locator("#plot").scroll_into_view_if_needed()
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
    assert after["scan"]["accuracy_mm"] == before["scan"]["accuracy_mm"] == 0.02
    assert running.client.job(again).inputs == registered.inputs
    assert (
        after["segments"]["design"]["count"] >= would
    )  # what the table of the file does not have may come to it
    assert after["segments"]["design"]["count"] != len(centres) or would == len(centres)
    expect(page.locator("#warnings")).to_contain_text("chosen by hand")
    expect(page.locator("#plot .centre")).to_have_count(after["segments"]["design"]["count"])
    expect(page.locator("#delta-min")).to_have_value(str(delta_min))


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
    page.locator("#how > summary").press("Enter")
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
        "fit",
        "projection",
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
