"""The tools of the viewer: section plane, segments by name, limits set on the design, projections, pins."""

import json
import re
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import trimesh
from playwright.sync_api import Page, Route, expect

from pipeline.core.acceptance import Acceptance, BoxRegion, SphereRegion
from pipeline.core.mesh import Mesh
from pipeline.report.glb import DisplayMesh, write_glb
from service.contract.schemas import Job
from tests.support.browser import Watched, changed, drag, hover_over, pixels, results, rewritten
from tests.support.running import RunningService
from tests.support.shapes import grid_plane, torus

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]

WIDTHS = (1200, 800, 390)


def middle(page: Page, x: float = 0.5, y: float = 0.5) -> dict[str, float]:
    """A place of the canvas by its shares."""
    box = page.locator("#canvas").bounding_box()
    assert box is not None
    return {"x": box["width"] * x, "y": box["height"] * y}


def scale_bar(page: Page) -> tuple[float, float]:
    """Its length on the screen in pixels, and what is written on it in mm."""
    expect(page.locator("#overlay .bar")).to_have_count(1)
    label = page.locator("#overlay .label", has_text="mm").text_content() or ""
    width = page.evaluate("document.querySelector('#overlay .bar').getBBox().width")
    return float(width), float(label.split(" ")[0])


def place_of(page: Page, field: str) -> np.ndarray:
    return np.array([float(part) for part in page.input_value(field).split(",")])


def test_rows_of_figures_are_whole_at_any_width(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        whole = page.locator("#figures").bounding_box()
        assert whole is not None
        rows: dict[float, float] = {}
        for tile in page.locator("#figures > div").all():
            box = tile.bounding_box()
            assert box is not None
            rows[box["y"]] = max(rows.get(box["y"], 0.0), box["x"] + box["width"])
        assert list(rows.values()) == pytest.approx([whole["x"] + whole["width"]] * len(rows), abs=1), width


def test_the_section_plane_is_dragged_on_the_part(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    page.uncheck("#show-pins")
    handle = page.locator("#section-handle")
    expect(handle).to_be_hidden()
    page.click("#sides button:text-is('+z')")
    plain = pixels(page)
    page.click("#section summary")
    page.select_option("#section-axis", "x")
    expect(page.locator("#overlay .plane")).to_have_count(1)
    page.fill("#section-mm", "0")
    width, length = scale_bar(page)
    drag(page, "#section-handle", (width, 30))  # what is across the axis does not count
    for field in ("#section-mm", "#section-slider"):
        assert float(page.input_value(field)) == pytest.approx(length, rel=0.05)
    before = float(page.input_value("#section-mm"))
    step = float(page.get_attribute("#section-slider", "step") or "")
    for key, steps in (("ArrowRight", 1), ("ArrowDown", -1), ("PageUp", 10)):
        handle.press(key)
        assert float(page.input_value("#section-mm")) == pytest.approx(before + steps * step, abs=0.002), key
        before = float(page.input_value("#section-mm"))
    expect(handle).to_have_attribute("aria-valuetext", f"x {before:g} mm")
    handle.press("Home")
    assert float(page.input_value("#section-mm")) == pytest.approx(
        float(page.get_attribute("#section-slider", "min") or ""), abs=0.001
    )
    page.click("#section summary")
    expect(handle).to_be_hidden()
    assert changed(pixels(page), plain) < 0.002  # the outlines went with it


def test_outlines_of_design_and_scan_lie_on_the_part(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    page.uncheck("#show-pins")
    page.click("#section summary")
    page.select_option("#section-axis", "z")
    page.fill("#section-mm", "0")
    page.click("#sides button:text-is('+z')")
    for name in ("overlay", "section-handle"):  # what lies over the picture is not asked for
        page.evaluate(f"document.getElementById('{name}').style.visibility = 'hidden'")
    measured = pixels(page)
    page.select_option("#section-times", "100")
    exaggerated = pixels(page)
    assert changed(exaggerated, measured) > 0.002
    page.select_option("#pose", "before")  # deviations are those of the final pose
    page.select_option("#pose", "final")
    page.click("#sides button:text-is('+z')")
    assert changed(pixels(page), exaggerated) < 0.002


def test_what_is_cut_away_is_not_under_the_pointer(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    page.click("#sides button:text-is('+z')")
    height, width = pixels(page).shape[:2]
    assert hover_over(page, height / 2, width / 2).startswith("scan")
    page.click("#section summary")
    page.select_option("#section-axis", "x")
    page.check("#clip")
    page.fill("#section-mm", page.get_attribute("#section-slider", "min") or "")
    page.locator("#canvas").scroll_into_view_if_needed()
    assert hover_over(page, height / 2, width / 2) == ""


def test_segments_are_hidden_by_name(watched: Watched, registered: Job, running: RunningService) -> None:
    design = registered.inputs.design
    assert design is not None
    centres = results(running, registered.id)["segments"]["design"]["centres"]
    kept = {
        "regions": [
            {"name": "seat", "region": {"kind": "segments", "segments": [0]}},
            {"name": "rim", "region": {"kind": "segments_at", "places_mm": [centres[1]["position_mm"]]}},
        ]
    }
    address = f"{running.client.server}/v1/designs/{design.blob}/characteristics"
    httpx.put(address, json=kept).raise_for_status()
    page = watched.open(registered)
    page.uncheck("#show-pins")
    shown = pixels(page)
    page.click("#segments summary")
    listed = page.locator("#segment-list label")
    expect(listed).to_have_count(len(centres))
    expect(listed.nth(0)).to_have_text("seat (segment 0)")
    expect(listed.nth(centres[1]["segment"])).to_have_text(f"rim (segment {centres[1]['segment']})")
    expect(page.locator("#segment-note")).to_have_text("")
    page.check("#segments-colour")
    coloured = pixels(page)
    assert changed(coloured, shown) > 0.02
    page.fill("#tolerance-mm", "0.2")  # the scale stays away from the colours of the segments
    assert changed(pixels(page), coloured) == 0.0
    page.fill("#tolerance-mm", "0.05")
    page.uncheck("#segments-colour")
    page.uncheck("#segment-list input[value='0']")
    expect(page.locator("#segment-note")).to_contain_text("1 segment hidden")
    page.click("#segments-none")
    empty = pixels(page)
    assert (np.abs(empty - empty[2, 2]).max(axis=2) > 8).mean() < 0.01  # nothing is left of the part
    height, width = empty.shape[:2]
    assert hover_over(page, height / 2, width / 2) == ""
    page.click("#segments-all")
    assert changed(pixels(page), shown) < 0.002
    httpx.delete(address).raise_for_status()


def test_segments_of_one_mesh_are_hidden(watched: Watched, marked: Job) -> None:
    page = watched.open(marked)
    page.uncheck("#show-landmarks")
    expect(page.locator("#segments-colour")).to_be_hidden()
    page.click("#segments summary")
    expect(page.locator("#segment-note")).to_have_text("")
    whole = pixels(page)
    page.uncheck("#segment-list input[value='0']")
    assert changed(pixels(page), whole) > 0.002


def test_limits_are_set_by_clicking_on_the_design(watched: Watched, registered: Job, design: Path) -> None:
    page = watched.open(registered)
    page.click("#limits summary")
    page.click("#sides button:text-is('+z')")
    page.click("#limit-add")
    expect(page.locator("#limit-refused")).to_contain_text("Click the point on the design")
    page.click("#canvas", position=middle(page))
    page.click("#limit-add")
    expect(page.locator("#limit-refused")).to_contain_text("Give it a name")
    page.fill("#limit-name", "seat")
    page.click("#limit-add")
    expect(page.locator("#limit-refused")).to_contain_text("Give a lower or an upper limit")
    page.fill("#limit-lower", "-0.1")
    page.fill("#limit-upper", "0.2")
    page.fill("#limit-reach", "1.5")
    point = place_of(page, "#limit-place-1")
    page.click("#limit-add")
    expect(page.locator("#overlay .words", has_text="seat")).to_have_count(1)

    page.select_option("#limit-kind", "sphere")
    page.fill("#limit-place-1", "1, 2, 3")  # without a pointer
    page.fill("#limit-name", "seat")
    page.click("#limit-add")
    expect(page.locator("#limit-refused")).to_contain_text("The name seat is taken")
    page.fill("#limit-name", "boss")
    page.click("#limit-add")

    page.select_option("#limit-kind", "box")
    corners = []
    for share, field in ((0.45, "#limit-place-1"), (0.55, "#limit-place-2")):
        page.click("#canvas", position=middle(page, share, share))
        corners.append(place_of(page, field))
    page.fill("#limit-name", "flank")
    page.fill("#limit-lower", "")
    page.click("#limit-add")

    made = Acceptance.model_validate_json(page.input_value("#limits-json"))
    surface = trimesh.load_mesh(design)
    (seat,) = made.points
    assert (seat.name, seat.lower_mm, seat.upper_mm, seat.radius_mm) == ("seat", -0.1, 0.2, 1.5)
    assert seat.position_mm == pytest.approx(point)
    _, (away,), (face,) = trimesh.proximity.closest_point(surface, [seat.position_mm])
    assert away < 0.001
    assert seat.normal is not None
    assert np.dot(seat.normal, surface.face_normals[face]) > 0.9  # outwards
    boss, flank = made.regions
    assert boss.region == SphereRegion(kind="sphere", centre_mm=[1, 2, 3], radius_mm=1.5)
    assert isinstance(flank.region, BoxRegion)
    assert flank.region.min_mm == pytest.approx(np.min(corners, axis=0) - 1.5, abs=1e-3)
    assert flank.region.max_mm == pytest.approx(np.max(corners, axis=0) + 1.5, abs=1e-3)
    assert (flank.lower_mm, flank.upper_mm) == (None, 0.2)

    page.click("#limit-table button[aria-label='remove boss']")
    page.click("#limits-use")
    expect(page.locator("#acceptance-json")).to_have_value(re.compile("flank"))
    page.fill("input[name=min_within]", "25")
    sent: list[dict[str, Any]] = []

    def taken(route: Route) -> None:
        if route.request.method != "POST":
            route.continue_()
            return
        sent.append(json.loads(route.request.post_data or "")["options"])
        route.fulfill(status=202, json={"id": registered.id})

    page.route("**/v1/jobs", taken)
    page.click("#go")
    expect(page.locator("#job")).to_be_visible()
    page.unroute("**/v1/jobs")
    asked = Acceptance.model_validate(sent[0]["acceptance"])
    assert asked == made.model_copy(update={"regions": [flank], "min_within": 0.25})


def test_limits_that_are_no_json_are_refused(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    page.click("#new-again")
    expect(page.locator(".slot[data-mesh=scan] output")).to_contain_text("scan.stl")
    page.click("#acceptance-box summary")
    for text, words in (("{tolerance", "not JSON"), ("[1]", "give a JSON object")):
        page.fill("#acceptance-json", text)
        page.click("#go")
        expect(page.locator("#refused")).to_contain_text(words)


def test_pins_show_what_was_inspected(watched: Watched, registered: Job) -> None:
    def inspected(document: dict[str, Any]) -> None:
        point = {"kind": "point", "region": None, "lower": -0.1, "upper": 0.1, "unit": "mm", "n": 9}
        at = {"uncertainty": None, "position_mm": document["segments"]["design"]["centres"][0]["position_mm"]}
        document["inspection"]["checks"] = [
            {"name": name, "value": value, "passed": passed, **point, **at}
            for name, value, passed in (("A", 0.31, False), ("B", 0.02, True), ("C", None, None))
        ]

    rewritten(watched.page, inspected)
    page = watched.open(registered)
    for words, mood in (("A +0.310 mm", "bad"), ("B +0.020 mm", "good"), ("C not measured", "warn")):
        expect(page.locator("#overlay .words", has_text=words)).to_have_count(1)
        expect(page.locator(f"#overlay .plate.{mood}")).to_have_count(1)
    page.uncheck("#show-pins")
    expect(page.locator("#overlay .plate")).to_have_count(0)
    page.unroute("**/results")


def test_the_scale_bar_is_true_and_a_projection_keeps_the_part(watched: Watched, registered: Job) -> None:
    page = watched.open(registered)
    page.click("#sides button:text-is('+z')")
    page.click("#distance summary")
    width, length = scale_bar(page)
    start = middle(page)
    for shift in (-width / 2, width / 2):
        page.click("#canvas", position={"x": start["x"] + shift, "y": start["y"]})
    told = re.search(r"Δx \+([\d.]+)", page.locator("#distance-words").inner_text())
    assert told and float(told[1]) == pytest.approx(length, rel=0.03)
    page.click("#distance-clear")
    page.uncheck("#show-pins")
    flat = pixels(page)
    page.click("#projection")
    expect(page.locator("#projection")).to_have_attribute("aria-pressed", "true")
    deep = pixels(page)
    covered = [(np.abs(image - image[2, 2]).max(axis=2) > 8).mean() for image in (flat, deep)]
    assert covered[1] == pytest.approx(covered[0], rel=0.25)
    assert changed(deep, flat) > 0.001
    page.click("#projection")
    assert changed(pixels(page), flat) < 0.002


DRAWN_TWICE = """async (at) => {
  const [{ Viewer }, { Pace }] = await Promise.all([import('/web/viewer.js'), import('/web/pace.js')]);
  const canvas = document.createElement('canvas');
  canvas.style.cssText = 'position: fixed; inset: 0; width: 300px; height: 200px; background: white';
  document.body.append(canvas);
  const viewer = new Viewer(canvas, { onHover() {}, onPick() {} });
  viewer.resize();
  await viewer.load('scan', await (await fetch(at)).arrayBuffer(), 'glb');
  viewer.view.frame('oblique');
  const { drawing, scan } = viewer;
  const seen = () => {
    const copy = new OffscreenCanvas(300, 200).getContext('2d');
    copy.drawImage(canvas, 0, 0, 300, 200);
    return copy.getImageData(0, 0, 300, 200).data;
  };
  const apart = (one, other) => one.reduce((sum, part, k) => sum + (Math.abs(part - other[k]) > 8), 0);
  const pictures = [];
  const draw = async (act) => {
    drawing.turn += 1;
    clearTimeout(drawing.rest);
    while (drawing.isBusy) await new Promise((resolve) => { setTimeout(resolve, 20); });
    await act();
    pictures.push(seen());
  };
  const level = (k) => () => {
    drawing.resolve(1);
    viewer.prepare();
    scan.draw(k);
    viewer.renderer.render(viewer.scene, viewer.view.camera);
  };
  await draw(level(0));
  await draw(level(1));
  drawing.pace = new Pace([scan.size(0), scan.size(1)]);
  await draw(() => drawing.inSlices());
  const backs = [];
  const { array } = scan.levels[1].index;
  for (let k = 0; k < array.length; k += 3) {
    const [a, b, c] = [0, 1, 2].map((part) => scan.position(array[k + part]));
    const [u, v] = [b, c].map((end) => end.map((part, axis) => part - a[axis]));
    const normal = [0, 1, 2].map((x) => u[(x + 1) % 3] * v[(x + 2) % 3] - u[(x + 2) % 3] * v[(x + 1) % 3]);
    if (normal.reduce((sum, part, axis) => sum + part * scan.normal(array[k])[axis], 0) < 0) backs.push(k);
  }
  const told = {
    sizes: [scan.size(0), scan.size(1)], backs: backs.length, drawn: canvas.dataset.drawn,
    bySlices: apart(pictures[0], pictures[2]), byLevel: apart(pictures[0], pictures[1]),
  };
  viewer.close();
  canvas.remove();
  return told;
}"""


def test_a_large_surface_is_drawn_whole_in_slices_and_coarsely_while_it_moves(
    watched: Watched, tmp_path: Path
) -> None:
    mesh = torus(15.0, 6.0, 120, 250)
    grey = np.full((len(mesh.vertices), 3), 0.6)
    write_glb(tmp_path / "large.glb", DisplayMesh(mesh), grey, deviation_mm=np.zeros(len(mesh.vertices)))
    watched.page.route("**/large.glb", lambda route: route.fulfill(path=tmp_path / "large.glb"))
    told = watched.page.evaluate(DRAWN_TWICE, "/large.glb")
    whole, coarse = told["sizes"]
    assert (whole, told["drawn"]) == (60_000, "whole")
    assert coarse == pytest.approx(whole / 4, rel=0.4)
    assert told["backs"] < 0.01 * coarse  # it faces as the whole does
    assert told["bySlices"] == 0  # pixel by pixel what one drawing gives
    assert 0 < told["byLevel"] < 0.05 * 300 * 200 * 4


PACED = """async () => {
  const { Pace } = await import('/web/pace.js');
  const levels = (fixed, each) => {
    const pace = new Pace([1e6, 250e3, 62e3, 15e3, 7e3]);
    const slices = [];
    for (let k = 0; k < 12; k += 1) {
      const count = pace.slice;
      pace.drewSlice(count, fixed + each * count);
      slices.push(fixed + each * count);
    }
    for (let k = 0; k < 300; k += 1) pace.drew(pace.level, fixed + each * pace.counts[pace.level]);
    return [pace.level, pace.isAtOnce, Math.max(...slices.slice(3))];
  };
  return [levels(2, 1e-5), levels(5, 3e-4), levels(20, 3e-3)];
}"""


def test_the_level_follows_from_the_time_of_frames(watched: Watched) -> None:
    """A graphics card, a slow one, and software: ms of a frame, and for each triangle."""
    card, slow, software = watched.page.evaluate(PACED)
    assert card[:2] == [0, True]
    assert slow[:2] == [2, False]  # 62,000 triangles take 24 ms, 250,000 take 80
    assert software[0] in (3, 4) and software[1] is False
    assert max(slow[2], software[2]) < 100  # ms of a slice, once it is known


SIDES = """async (at) => {
  const { Viewer } = await import('/web/viewer.js');
  const canvas = document.createElement('canvas');
  canvas.style.cssText = 'position: fixed; inset: 0; width: 200px; height: 200px; background: white';
  document.body.append(canvas);
  const told = {};
  for (const isShaded of [true, false]) {
    const fresh = canvas.cloneNode();
    document.body.append(fresh);
    const viewer = new Viewer(fresh, { onHover() {}, onPick() {} });
    viewer.resize();
    const file = async () => (await fetch(at)).arrayBuffer();
    await viewer.load('design', await file(), 'glb');
    await viewer.load('scan', await file(), 'glb');
    viewer.show('design', false);
    if (isShaded) viewer.shadeBacks();
    for (const [side, name] of [['+z', 'front'], ['\u2212z', 'back']]) {
      viewer.view.frame(side);
      await new Promise((resolve) => { viewer.onDrawn = resolve; viewer.draw(); });
      const copy = new OffscreenCanvas(1, 1).getContext('2d');
      copy.drawImage(fresh, fresh.width / 2, fresh.height / 2, 1, 1, 0, 0, 1, 1);
      told[`${isShaded ? 'shaded' : 'plain'} ${name}`] = [...copy.getImageData(0, 0, 1, 1).data].slice(0, 3);
    }
    viewer.close();
    fresh.remove();
  }
  canvas.remove();
  return told;
}"""


def test_the_back_of_an_open_surface_is_drawn_darker_than_its_front(watched: Watched, tmp_path: Path) -> None:
    """The middle pixel of a plane in the light of the eye, from its front, +z, and from its back."""
    plane = grid_plane()
    sheet = Mesh(plane.vertices, plane.faces)
    colour = np.full((len(sheet.vertices), 3), 0.6)
    values = np.zeros(len(sheet.vertices))
    write_glb(tmp_path / "sheet.glb", DisplayMesh(sheet), colour, deviation_mm=values)
    watched.page.route("**/sheet.glb", lambda route: route.fulfill(path=tmp_path / "sheet.glb"))
    told = watched.page.evaluate(SIDES, "/sheet.glb")
    front, back = np.array(told["shaded front"]), np.array(told["shaded back"])
    assert np.all(front > back + 40)
    assert told["shaded front"] == told["plain front"]  # the front has its own colour
    assert told["plain back"] == told["plain front"]  # without the shade both look alike
