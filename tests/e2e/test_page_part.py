"""The part on the page: the first screen, colours, pins, section, distance; and what was wrong once."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from playwright.sync_api import Page, Route, expect

from pipeline.core.mesh import Mesh
from pipeline.report.glb import DisplayMesh, write_glb
from service.contract.schemas import Job
from tests.support.browser import Watched, coloured, hover_over, pixels, results, rewritten
from tests.support.running import RunningService
from tests.support.shapes import icosphere

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]

SWITCHES = ("#show-scan", "#show-design", "#show-landmarks", "#show-matches", "#show-pins")


def dropped(page: Page, selector: str, names: list[str]) -> bool:
    """Files of these names on the element; whether the page kept the browser from opening them."""
    return bool(
        page.evaluate(
            """([selector, names]) => {
                const data = new DataTransfer();
                for (const name of names) data.items.add(new File(['solid a'], name));
                const how = {dataTransfer: data, bubbles: true, cancelable: true};
                const made = (kind) => new DragEvent(kind, how);
                const target = document.querySelector(selector);
                const isKept = !target.dispatchEvent(made('dragover'));
                return isKept && !target.dispatchEvent(made('drop'));
            }""",
            [selector, names],
        )
    )


def test_the_first_screen_shows_the_numbers_and_the_worst_place(
    watched: Watched, registered: Job, running: RunningService
) -> None:
    page = watched.open(registered)
    deviation = results(running, registered.id)["deviation"]
    for name, value in (("min", deviation["min_mm"]), ("max", deviation["max_mm"])):
        shown = f"{value:+.3f} mm".replace("-", "\N{MINUS SIGN}")
        expect(page.locator("#figures div", has=page.locator(f"dt:text-is('{name}')"))).to_contain_text(shown)
        expect(page.locator("#overlay .words", has_text=f"{name} {shown}")).to_have_count(1)
    names = page.locator("#figures dt").all_inner_texts()
    assert names[:7] == ["min", "max", "within ±0.05 mm", "RMS", "mean", "SD", "coverage"]
    expect(page.locator("#figures")).to_contain_text("not applied")
    expect(page.locator("#identity-list")).to_contain_text("design.stl")
    assert page.locator("#overlay .pin:not(.hidden)").count() >= 1  # the first view shows where it is
    plates = page.locator("#overlay .plate").all()
    boxes = [plate.bounding_box() for plate in plates]
    for k, box in enumerate(boxes):
        for other in boxes[:k]:
            assert box and other
            apart_x = box["x"] + box["width"] <= other["x"] or other["x"] + other["width"] <= box["x"]
            apart_y = box["y"] + box["height"] <= other["y"] or other["y"] + other["height"] <= box["y"]
            assert apart_x or apart_y
    expect(page.locator("#graph")).to_be_hidden()  # the method is folded away
    page.click("#how > summary")
    expect(page.locator("#how-figures div", has=page.locator("dt:text-is('K')"))).to_contain_text("landmarks")
    expect(page.locator("#graph")).to_be_visible()


def test_any_tolerance_counts_and_the_scale_is_edited(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    page.fill("#tolerance-mm", "5")  # far beyond the end of the scale
    expect(page.locator("#within")).to_contain_text("100.0 % of the area lies within")
    expect(page.locator("#scale-high")).to_have_value("10")
    page.click("#scale-box summary")
    page.fill("#tolerance-low", "0")
    page.fill("#tolerance-high", "0.02")
    expect(page.locator("#tolerance-mm")).to_have_value("")  # it is not symmetric
    page.fill("#scale-high", "0.04")
    expect(page.locator("#scale-high")).to_have_value("0.04")
    few = coloured(pixels(page))
    page.select_option("#scale-kind", "5")
    assert coloured(pixels(page)) != few
    page.click("#scale-reset")
    expect(page.locator("#tolerance-mm")).to_have_value("0.05")


def test_rounding_has_no_colour(watched: Watched, registered: Job) -> None:
    def exact(document: dict[str, Any]) -> None:
        nothing = {"p01_mm": -3e-5, "p99_mm": 3e-5, "tolerance_mm": None, "within": None}
        document["deviation"] |= nothing
        document["deviation"]["sign"] = "open"
        document["scan"] |= {"accuracy_mm": None, "noise_mm": None}

    rewritten(watched.page, exact)
    page = watched.open(registered)
    assert float(page.input_value("#scale-high")) >= 0.004  # 1e-4 of a diagonal of more than 40 mm
    expect(page.locator("#sign")).to_contain_text("below the surface")  # an open surface has no material
    expect(page.locator("#sign")).not_to_contain_text("missing")
    page.unroute("**/results")


def test_poses_change_nothing_else(watched: Watched, registered: Job, symmetric: Job, marked: Job) -> None:
    page = watched.open(symmetric)
    first = page.locator("#pose option").all_inner_texts()
    assert first[:2] == ["final", "as uploaded"]
    expect(page.locator("#meaning")).to_contain_text("each is correct")
    expect(page.locator("#meaning")).to_contain_text("Every other pose fits clearly worse")
    page = watched.open(registered)
    plain = coloured(pixels(page))
    page.check("#show-design")
    assert coloured(pixels(page)) < plain + 0.01  # a grey veil, no stripes in the colours of the segments
    before = [page.is_checked(switch) for switch in SWITCHES]
    page.click("#before")
    assert [page.is_checked(switch) for switch in SWITCHES] == before
    expect(page.locator("#pose-note")).to_contain_text("final pose")
    page.click("#how > summary")
    page.hover("#plot")
    watched.open(marked)
    expect(page.locator("#pose-note")).to_have_text("")  # of the job before
    page.goto(f"{watched.server}/#")
    page.dispatch_event("#plot svg", "pointerleave")  # of a graph that is no more: no error


def test_a_job_without_a_pose_says_why_first(watched: Watched, registered: Job) -> None:
    def refuse(document: dict[str, Any]) -> None:
        reason = {"code": "low_fitness", "detail": "12% of the scan lies on the design", "value": 0.12}
        about = {"code": "free_motion", "detail": "the rotation is uncertain", "value": 3.0}
        document["verdict"] |= {"status": "no_match", "confidence": 0.0, "findings": [about, reason]}
        document |= {"transform": None, "deviation": None, "deviation_of_design": None, "scale": None}

    rewritten(watched.page, refuse)
    page = watched.open(registered)
    expect(page.locator("#findings")).to_have_text("low fitness: 12% of the scan lies on the design")
    expect(page.locator("#rejected-findings")).to_be_hidden()
    page.click("#about-rejected summary")
    expect(page.locator("#rejected-findings")).to_contain_text("the rotation is uncertain")
    page.unroute("**/results")


def test_a_cloud_has_a_legend_and_values(watched: Watched, registered: Job, tmp_path: Path) -> None:
    points = icosphere(20.0, 4).vertices
    write_glb(
        tmp_path / "cloud.glb",
        DisplayMesh(Mesh(points, np.zeros((0, 3), dtype=np.int32))),
        np.tile([0.9, 0.9, 0.9], (len(points), 1)),
        deviation_mm=np.full(len(points), 0.125),
    )
    watched.page.route("**/deviation.glb", lambda route: route.fulfill(path=tmp_path / "cloud.glb"))
    page = watched.open(registered)
    expect(page.locator("#legend")).to_be_visible()
    page.fill("#tolerance-mm", "0.2")
    expect(page.locator("#within")).to_contain_text("100.0 % of the points lie within")
    page.uncheck("#show-design")
    height, width = pixels(page).shape[:2]
    said = [hover_over(page, height / 2 + k, width / 2 + 3 * k) for k in range(-12, 13, 4)]
    assert any("deviation +0.125 mm" in each for each in said), said
    page.unroute("**/deviation.glb")


def test_a_section_and_a_distance(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    page.click("#section summary")
    expect(page.locator("#section-note")).to_contain_text("Black: design. Coloured: scan")
    inked = "[...document.querySelector('#section-plot').getContext('2d').getImageData(0, 0, 1000, 600).data]"
    drawn = page.evaluate(f"{inked}.filter((part, k) => k % 4 === 3 && part > 0).length")
    assert drawn > 1000
    page.select_option("#section-times", "20")
    expect(page.locator("#section-note")).to_contain_text("20 times as large")
    assert page.evaluate(f"{inked}.filter((part, k) => k % 4 === 3 && part > 0).length") != drawn
    page.uncheck("#show-pins")
    whole = pixels(page)
    page.check("#clip")
    inside = pixels(page)
    assert np.abs(inside - whole).max(axis=2).mean() > 1.0  # a part of it is cut away
    page.uncheck("#clip")
    page.fill("#section-mm", "1000")
    expect(page.locator("#section-note")).to_contain_text("misses the part")
    page.click("#section summary")
    page.click("#distance summary")
    page.click("#sides button:text-is('+z')")
    height, width = whole.shape[:2]
    for share in (0.45, 0.55):
        page.click("#canvas", position={"x": width * share, "y": height / 2})
    expect(page.locator("#distance-words")).to_contain_text("Δx +")
    expect(page.locator("#overlay .ruler")).to_have_count(3)
    page.click("#distance-clear")
    expect(page.locator("#overlay .ruler")).to_have_count(0)


LIMITS: dict[str, Any] = {
    "min_within": 0.25,
    "upper_mm": 0.3,
    "uncertainty_mm": 0.01,
    "points": [{"name": "seat", "position_mm": [1, 2, 3], "radius_mm": 2, "upper_mm": 0.1}],
    "regions": [{"name": "rim", "region": {"kind": "segments", "segments": [1]}, "max_deviation_mm": 0.2}],
}


def test_a_new_job_remembers_what_was_asked(watched: Watched, running: RunningService, design: Path) -> None:
    """Also of a job that was cancelled, and has no results."""
    asked = {"tolerance_mm": None, "scan_accuracy_mm": 0.02, "label": "with limits", "preset": "paper"}
    asked |= {"units": {"design": "inch"}, "columns": "1,2,3", "acceptance": LIMITS}
    job = running.client.submit(design, design, {key: each for key, each in asked.items() if each})
    running.client.cancel(job.id)
    page = watched.page
    page.goto(f"{watched.server}/#again-{job.id}")
    for name, value in (("scan_accuracy_mm", "0.02"), ("label", "with limits"), ("columns", "1,2,3")):
        expect(page.locator(f"input[name={name}]")).to_have_value(value)
    expect(page.locator("select[name=preset]")).to_have_value("paper")
    expect(page.locator(".slot[data-mesh=design] [data-what=unit]")).to_have_value("inch")
    for name, value in (("min_within", "25"), ("upper_mm", "0.3"), ("lower_mm", ""), ("min_coverage", "")):
        expect(page.locator(f"input[name={name}]")).to_have_value(value)
    stated = json.loads(page.input_value("#acceptance-json"))
    assert stated == {key: LIMITS[key] for key in ("uncertainty_mm", "points", "regions")}


def test_limits_of_a_job_without_a_pose_are_kept_for_the_next(watched: Watched, registered: Job) -> None:
    def refuse(document: dict[str, Any]) -> None:
        document["verdict"] |= {"status": "no_match", "confidence": 0.0}
        document |= {"transform": None, "deviation": None, "deviation_of_design": None, "scale": None}
        document["inspection"] |= {"checks": [], "rule": "a rule", "patch_mm": None}

    page = watched.page
    rewritten(page, refuse)
    kept = LIMITS | {"min_coverage": 0.5}
    page.route("**/options", lambda route: route.fulfill(json=_options(route) | {"acceptance": kept}))
    watched.open(registered)
    expect(page.locator("#counts")).to_contain_text("No limit was judged: without a valid alignment")
    page.click("#limits summary")
    expect(page.locator("#limits-unjudged")).to_contain_text("for the next job")
    for field, value in (("name", "seat"), ("place-1", "4, 5, 6"), ("lower", "-0.3"), ("reach", "1")):
        page.fill(f"#limit-{field}", value)
    page.click("#limit-add")
    page.click("#limits-use")
    expect(page.locator("input[name=tolerance_mm]")).to_have_value("0.05")
    expect(page.locator("input[name=min_coverage]")).to_have_value("50")
    stated = json.loads(page.input_value("#acceptance-json"))
    (seat,) = stated["points"]  # what was set anew takes the place of what had its name
    assert (seat["position_mm"], seat["lower_mm"]) == ([4, 5, 6], -0.3)
    assert stated["regions"] == LIMITS["regions"]
    page.unroute("**/options")
    page.unroute("**/results")


def _options(route: Route) -> dict[str, Any]:
    found: dict[str, Any] = route.fetch().json()
    return found


def test_files_are_dropped_where_they_belong(watched: Watched) -> None:
    page = watched.page
    expect(page.locator(".slot[data-mesh=scan] output")).to_contain_text("Drop a file")
    assert dropped(page, "header", ["part.stl"])  # the browser does not open it
    expect(page.locator("#refused")).to_contain_text("Drop the file on one of: design, scan")
    assert dropped(page, ".slot[data-mesh=design]", ["a.stl", "b.stl"])
    expect(page.locator("#refused")).to_contain_text("2 files were dropped")
    expect(page.locator(".slot[data-mesh=design] output")).to_contain_text("Drop a file")
    assert dropped(page, ".slot[data-mesh=design]", ["a.stl"])
    expect(page.locator(".slot[data-mesh=design] output")).to_have_text("a.stl")
    assert dropped(page, "header", ["b.stl"])  # the one that is missing
    expect(page.locator(".slot[data-mesh=scan] output")).to_have_text("b.stl")


def test_the_page_prints_without_buttons_and_the_graph_fits_its_axes(
    watched: Watched, registered: Job
) -> None:
    page = watched.open(registered)
    page.click("#how > summary")
    page.emulate_media(media="print")
    assert page.locator("button:visible").count() == 0
    page.set_viewport_size({"width": 700, "height": 1000})
    boxes = json.loads(
        page.evaluate(
            "JSON.stringify(['canvas', 'svg'].map((tag) => document.querySelector(`#plot ${tag}`)"
            ".getBoundingClientRect()))"
        )
    )
    assert boxes[0] == pytest.approx(boxes[1], abs=1.5)
    page.emulate_media(media="screen")
