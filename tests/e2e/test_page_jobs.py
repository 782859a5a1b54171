"""Jobs made on the page: from meshes sent before, of one mesh, cancelled, refused, failed."""

import json
import re
from pathlib import Path

import httpx
import numpy as np
import pytest
import trimesh
from playwright.sync_api import expect

from service.contract.schemas import Job
from tests.support.browser import JOB_MS, Watched, changed, finished, hover_over, pixels, quickly, results
from tests.support.running import LONG, QUICK, RunningService

pytestmark = [pytest.mark.e2e, pytest.mark.timeout(600)]


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
    quickly(page)
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


def test_a_study_is_sent_and_shown(
    registered: Job, watched: Watched, design: Path, running: RunningService
) -> None:
    page = watched.page
    page.check("input[value=study]")
    expect(page.locator("#tolerance-field")).to_be_hidden()
    assert registered.inputs.design is not None
    page.select_option("[data-mesh=mesh] [data-what=earlier]", registered.inputs.design.blob)
    page.fill("input[name=trials]", "20")
    for tick in page.locator("#study-detectors input").all():
        tick.uncheck()
    page.click("#go")
    expect(page.locator("#refused")).to_contain_text("at least one landmark detector")
    for name in ("t2", "random"):
        page.check(f"#study-detectors input[value={name}]")
    with page.expect_request("**/v1/jobs") as sent:
        page.click("#go")
    study = {"kind": "informativeness", "detectors": ["t2", "random"], "trials": 20}
    assert sent.value.post_data_json["options"] == {"study": study}
    page.click("#cancel")  # the same with a coarse mesh, which the page does not offer
    settings = {"resample": {"target_vertices": 400}}
    given = {"type": "study", "options": json.dumps({"study": study, "settings": settings})}
    files = {"mesh": ("part.stl", design.read_bytes())}
    made = httpx.post(f"{running.client.server}/v1/jobs", data=given, files=files).json()["id"]
    watched.open(running.successful(made))
    found = results(running, made)
    expect(page.locator("#summary")).to_have_text(found["summary"])
    expect(page.locator("#study-table tbody tr")).to_have_count(len(found["informativeness"]))
    page.wait_for_function("document.querySelector('#study-picture').naturalWidth > 100")
    expect(page.locator("#viewer")).to_be_hidden()
    expect(page.locator("#graph")).to_be_hidden()
    page.goto(f"{watched.server}/#again-{made}")  # with what was asked for
    expect(page.locator("input[name=trials]")).to_have_value("20")
    expect(page.locator("#study-detectors input:checked")).to_have_count(2)


def test_a_running_job_is_watched_and_cancelled(
    watched: Watched, design: Path, running: RunningService
) -> None:
    job = running.client.submit(design, design, {**LONG, "label": "too long"})
    page = watched.page
    page.goto(f"{watched.server}/#{job.id}")
    expect(page.locator("#stages [aria-current=step]")).to_be_visible(timeout=JOB_MS)
    expect(page.locator("#stage")).to_have_attribute("role", "status")
    expect(page.locator("#elapsed")).to_contain_text("running for")
    behind = running.client.submit(design, design, {**LONG, "label": "behind"})
    last = running.client.submit(design, design, {**LONG, "label": "last"})
    page.goto(f"{watched.server}/#{last.id}")
    expect(page.locator("#elapsed")).to_contain_text("place 2 in the queue, no estimate", timeout=JOB_MS)
    for waiting in (last, behind):
        running.client.cancel(waiting.id)
    page.goto(f"{watched.server}/#{job.id}")
    expect(page.locator("#job-title")).to_be_focused()
    page.goto(f"{watched.server}/#")
    expect(page.locator("#job-rows tr", has_text="too long")).to_contain_text("running")
    page.click("#job-rows tr:has-text('too long') a")
    page.click("#cancel")
    expect(page.locator("#failed")).to_be_visible()  # its text may be that of the job before
    expect(page.locator("#failed")).to_contain_text("dismissed")
    assert running.client.job(job.id).status == "dismissed"
    page.on("dialog", lambda dialog: dialog.accept())
    page.click("#remove")
    expect(page.locator("#jobs")).to_be_visible()
    expect(page.locator("#job-rows")).not_to_contain_text("too long")


def test_the_list_is_used_by_keyboard(watched: Watched, registered: Job, running: RunningService) -> None:
    server, mesh = running.client.server, registered.inputs.design
    assert mesh is not None
    scans = [{"scan": {"blob": mesh.blob, "filename": f"many {n}.stl"}} for n in range(21)]
    request = {"design": {"blob": mesh.blob}, "scans": scans, "options": LONG}
    batch = httpx.post(f"{server}/v1/batches", json=request).json()["id"]
    httpx.post(f"{server}/v1/batches/{batch}/cancel")
    page, rows = watched.page, watched.page.locator("#job-rows tr")
    page.focus("#filter-name")
    page.keyboard.type("MANY ")
    page.keyboard.press("Enter")
    expect(rows).to_have_count(20)
    for _ in range(200):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.id") == "more":
            break
    page.keyboard.press("Enter")
    expect(rows).to_have_count(21)
    expect(page.locator("#more")).to_be_hidden()
    page.focus("#filter-name")
    page.keyboard.press("Control+A")
    page.keyboard.type("finished")
    page.keyboard.press("Enter")
    expect(rows).to_have_count(1)
    for name, key in (("verdict", "o"), ("decision", "n")):  # ok, not judged
        page.focus(f"#filter-{name}")
        page.keyboard.type(key)
    expect(rows).to_have_count(1)
    within = running.client.job(registered.id).within
    assert within is not None and within == results(running, registered.id)["deviation"]["within"]
    expect(rows.locator("td").last).to_contain_text("%")
    rows.locator("a").focus()
    page.keyboard.press("Enter")
    expect(page.locator("#job-title")).to_be_focused()


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


SPY_ON_OPTIONS = """() => {
  const append = FormData.prototype.append;
  FormData.prototype.append = function (name, value) {
    if (name === 'options') window.sentOptions = value;
    return append.apply(this, arguments);
  };
}"""


def test_limits_go_with_the_job_and_wrong_ones_are_refused(
    watched: Watched, running: RunningService, design: Path
) -> None:
    page = watched.page
    for mesh in ("design", "scan"):
        page.set_input_files(f"input[name={mesh}]", design)
    page.click("#acceptance-box summary")
    page.fill("#acceptance-json", '{"points": ')
    page.click("#go")
    expect(page.locator("#refused")).to_contain_text("not JSON")
    page.fill("#acceptance-json", '{"points": [{"name": "P1", "position_mm": [0, 0, 0], "radius_mm": 2}]}')
    page.click("#go")
    expect(page.locator("#refused")).to_contain_text("point 'P1' has no limits")
    page.fill("#acceptance-json", '{"uncertainty_mm": 0.01}')
    for name, value in {"lower_mm": 0.3, "upper_mm": 0.2, "max_deviation_mm": 5, "min_coverage": 80}.items():
        page.fill(f"input[name={name}]", str(value))
    page.click("#go")
    expect(page.locator("#refused")).to_contain_text("lower_mm (0.3) must be below upper_mm (0.2)")
    page.fill("input[name=lower_mm]", "-0.2")
    page.fill("input[name=min_confidence]", "55")
    page.evaluate(SPY_ON_OPTIONS)
    page.click("#go")
    expect(page.locator("#job")).to_be_visible()
    assert json.loads(page.evaluate("sentOptions"))["acceptance"] == {
        "uncertainty_mm": 0.01,
        "lower_mm": -0.2,
        "upper_mm": 0.2,
        "max_deviation_mm": 5,
        "min_coverage": 0.8,
        "min_confidence": 0.55,
    }
    running.client.cancel(page.url.rpartition("#")[2])
    watched.complaints.clear()  # the browser's own lines of the refusals


def test_a_job_that_fails_says_why(watched: Watched, design: Path, tmp_path: Path) -> None:
    page = watched.page
    (tmp_path / "flat.obj").write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", tmp_path / "flat.obj")
    page.click("#go")
    expect(page.locator("#failed")).to_contain_text("scan: ", timeout=JOB_MS)
    expect(page.locator("#new-again")).to_be_visible()


def test_the_part_of_a_design_is_chosen_where_the_job_says_there_are_several(
    watched: Watched, plate: Path, scan: Path
) -> None:
    page = watched.page
    expect(page.locator("#design-part")).to_be_hidden()  # folded: most files need none of it
    page.set_input_files("input[name=design]", plate)
    page.set_input_files("input[name=scan]", scan)
    page.click("#reading summary")
    page.fill("#design-part", "cover")
    page.click("#go")
    expect(page.locator("#failed")).to_contain_text("part_not_found", timeout=JOB_MS)
    expect(page.locator("#failed")).to_contain_text("1 blob, 2 pin")
    page.click("#offer-link")
    expect(page.locator("#part-hint")).to_contain_text("1 blob, 2 pin")
    expect(page.locator(".slot[data-mesh=design] output")).to_contain_text("plate.stl")
    expect(page.locator("#design-part")).to_be_focused()
    page.fill("#design-part", "blob")
    with page.expect_request("**/v1/jobs") as sent:
        page.click("#go")
    assert sent.value.post_data_json["options"] == {"design_part": "blob"}
    expect(page.locator("#failed")).to_be_hidden()
    page.click("#cancel")
    expect(page.locator("#failed")).to_contain_text("dismissed", timeout=JOB_MS)


def test_what_follows_a_job_on_one_part_is_on_that_part(
    watched: Watched, plate: Path, scan: Path, running: RunningService
) -> None:
    job = running.successful(running.client.submit(plate, scan, {**QUICK, "design_part": "blob"}).id)
    assert results(running, job.id)["provenance"]["inputs"]["design"]["part"] == "blob"
    page = watched.open(job)
    expect(page.locator("#warnings")).to_contain_text("1 blob is read (options.design_part)")
    page.click("#new-again")
    expect(page.locator("#design-part")).to_have_value("blob")
    page.check("input[value=landmarks]")
    expect(page.locator("#reading")).to_be_hidden()  # the options of a registration
    watched.open(job)
    page.click("#how > summary")
    with page.expect_request("**/v1/jobs") as sent:
        page.click("#again")
    assert sent.value.post_data_json["options"]["design_part"] == "blob"
    page.click("#cancel")


def test_the_columns_of_a_scan_are_stated_where_its_text_can_be_read_in_two_ways(
    watched: Watched, design: Path, scan: Path, tmp_path: Path
) -> None:
    points = trimesh.load_mesh(scan).vertices
    numbered = np.column_stack([np.arange(len(points)) * 3 + 7, np.round(points, 4)])  # ids with gaps
    np.savetxt(tmp_path / "points.txt", numbered, fmt=["%d", "%.4f", "%.4f", "%.4f"])
    page = watched.page
    page.set_input_files("input[name=design]", design)
    page.set_input_files("input[name=scan]", tmp_path / "points.txt")
    page.click("#go")
    expect(page.locator("#failed")).to_contain_text("options.columns", timeout=JOB_MS)
    expect(page.locator("#offer-link")).to_have_text("State the columns of the scan")
    page.click("#offer-link")
    expect(page.locator("#columns-hint")).to_contain_text("options.columns")
    page.fill("#columns", "id,x,y")
    page.click("#go")
    expect(page.locator("#refused")).to_contain_text("0 columns are named z")
    expect(page.locator("#columns")).to_be_focused()
    watched.complaints.clear()  # the browser's own line of the 422
    page.fill("#columns", "id,x,y,z")
    with page.expect_request("**/v1/jobs") as sent:
        page.click("#go")
    assert sent.value.post_data_json["options"]["columns"] == "id,x,y,z"
    expect(page.locator("#offer")).to_be_hidden()
    page.click("#cancel")


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
