"""Stalls and frames of the page's viewer on a million triangles, in Chromium with software rendering.

    python -m tests.accuracy.viewer [--triangles 1000000]

A torus by formula is shown in place of the surfaces of a small job. A stall is the longest task of the page's
main thread while a person does something: its wall time, and its processor time, which other work on the
machine does not change. Waiting for the graphics process is wall time only: without a graphics card the page
waits for each picture that it shows, which is of a coarser level while the view moves. Files of jobs have at
most 200,000 triangles (`remesh.MANY_FACES`).
"""

import argparse
import json
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from playwright.sync_api import Page, Route, sync_playwright

from pipeline.core.mesh import Mesh
from pipeline.report.glb import DisplayMesh, write_glb
from tests.support.browser import ARGUMENTS, CHROMIUM, Watched
from tests.support.meshes import blob_stl
from tests.support.running import QUICK, RunningService
from tests.support.shapes import torus

ACROSS = 500  # quads around the tube of the torus; the triangles asked for say how many along it
OPEN_MS = 240_000
TURN = """(seconds) => new Promise((resolve) => {
  const canvas = document.getElementById('canvas');
  const begun = performance.now();
  let pictures = 0;
  const count = new MutationObserver((all) => { pictures += all.length; }); // it is said of each picture
  count.observe(canvas, { attributeFilter: ['data-drawn'] });
  const next = () => {
    if (performance.now() - begun > 1000 * seconds) { resolve(pictures / seconds); return; }
    canvas.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowLeft'}));
    requestAnimationFrame(next);
  };
  next();
})"""


def measure(page: Page, what: str, act: Callable[[], object]) -> None:
    """Print the longest task while `act` runs, and until the page rests."""
    browser = page.context.browser
    assert browser is not None
    browser.start_tracing(page=page, categories=["toplevel"])
    act()
    page.wait_for_timeout(1500)
    events = json.loads(browser.stop_tracing())["traceEvents"]
    named = [each for each in events if each["name"] == "thread_name"]
    main = {(each["pid"], each["tid"]) for each in named if each["args"]["name"] == "CrRendererMain"}
    tasks = [each for each in events if each["ph"] == "X" and (each["pid"], each["tid"]) in main]
    wall, cpu = (max((each.get(key, 0) for each in tasks), default=0) / 1000 for key in ("dur", "tdur"))
    print(f"{what:<28} {wall:6.0f} ms wall {cpu:6.0f} ms processor", flush=True)


def surfaces(folder: Path, triangles: int) -> tuple[Path, Path]:
    """Design and scan as the page reads them."""
    mesh = torus(15.0, 6.0, triangles // (2 * ACROSS), ACROSS)
    display = DisplayMesh(Mesh(mesh.vertices, mesh.faces), mesh)
    grey = np.full((len(mesh.vertices), 3), 0.6)
    x, y, _ = mesh.vertices.T
    write_glb(folder / "design.glb", display, grey)
    write_glb(folder / "deviation.glb", display, grey, deviation_mm=0.2 * np.sin(x) * np.cos(y))
    return folder / "design.glb", folder / "deviation.glb"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--triangles", type=int, default=1_000_000)
    triangles = parser.parse_args().triangles
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        design_file, scan_file = folder / "design.stl", folder / "scan.stl"
        design_file.write_bytes(blob_stl())
        scan_file.write_bytes(blob_stl(23, 37))
        shown = dict(zip(("design.glb", "deviation.glb"), surfaces(folder, triangles), strict=True))
        running = RunningService(folder / "data", CUSP_JOBS="1")
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        try:
            options = {**QUICK, "tolerance_mm": 0.05}
            job = running.successful(running.client.submit(design_file, scan_file, options).id)
            context = browser.new_context(viewport={"width": 1200, "height": 1000})
            watched = Watched(context, running.client.server)

            def answer(route: Route) -> None:
                route.fulfill(path=shown[route.request.url.rsplit("/", 1)[1]])

            watched.page.route("**/files/*.glb", answer)

            def opened() -> None:
                watched.page.goto(f"{watched.server}/#{job.id}")
                watched.page.wait_for_selector("#result[data-shown]", timeout=OPEN_MS)

            print(f"{triangles:,} triangles of each surface\nlongest task while")
            _table(watched, opened)
        finally:
            browser.close()
            running.stop()


def _table(watched: Watched, opened: Callable[[], object]) -> None:
    page = watched.page
    measure(page, "opening the job", opened)
    page.wait_for_timeout(3000)
    measure(
        page, "moving the tolerance", lambda: [page.fill("#tolerance-mm", t) for t in ("0.1", "0.02", "0.15")]
    )
    box = page.locator("#canvas").bounding_box()
    assert box is not None
    centre = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def hover() -> None:
        for k in range(8):
            page.mouse.move(centre[0] + 15 * k, centre[1] + 4 * k)
            page.wait_for_timeout(200)

    measure(page, "pointing at the part", hover)
    print(f"{'':<28} {page.locator('#tip').inner_text()!r}")
    measure(page, "opening the section", lambda: page.click("#section summary"))
    measure(page, "moving the section", lambda: [page.fill("#section-mm", t) for t in ("1", "2", "3")])
    measure(page, "cutting the part open", lambda: page.check("#clip"))
    measure(page, "showing the design", lambda: page.check("#show-design"))
    page.uncheck("#show-design")
    pictures = []
    measure(page, "turning", lambda: pictures.append(page.evaluate(TURN, 4)))
    print(f"{'':<28} {pictures[0]:6.1f} pictures/s")
    begun = time.monotonic()
    page.locator("#canvas").press("ArrowLeft")
    page.wait_for_selector("#canvas[data-drawn=whole]", timeout=OPEN_MS)
    print(f"{'until the whole is drawn':<28} {time.monotonic() - begun:6.1f} s")


if __name__ == "__main__":
    main()
