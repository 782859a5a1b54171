"""One service for the tests that leave it as they found it, and the meshes they send."""

import json
from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest
import trimesh
from playwright.sync_api import Browser, sync_playwright

from service.contract.schemas import Job
from tests.support.browser import ARGUMENTS, CHROMIUM, TOLERANCE_MM, Watched
from tests.support.meshes import SHIFT_MM, TURN_DEG, blob_stl
from tests.support.running import QUICK, RunningService


@pytest.fixture(scope="session")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("meshes") / "design.stl"
    path.write_bytes(blob_stl())
    return path


@pytest.fixture(scope="session")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same shape by another triangulation, turned by TURN_DEG about z and then shifted by SHIFT_MM."""
    path = tmp_path_factory.mktemp("meshes") / "scan.stl"
    path.write_bytes(blob_stl(23, 37, turn_deg=TURN_DEG, shift_mm=SHIFT_MM))
    return path


@pytest.fixture(scope="session")
def plate(design: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The design and a pin beside it, as two solids of one file."""
    pin = trimesh.creation.cylinder(radius=2.0, height=12.0, transform=_beside(60.0))
    solids = {"blob": trimesh.load_mesh(design), "pin": pin}
    path = tmp_path_factory.mktemp("meshes") / "plate.stl"
    texts = [trimesh.exchange.stl.export_stl_ascii(mesh).split("\n", 1)[1] for mesh in solids.values()]
    path.write_text("".join(f"solid {name}\n{text}\n" for name, text in zip(solids, texts, strict=True)))
    return path


def _beside(x: float) -> np.ndarray:
    return trimesh.transformations.translation_matrix([x, 0.0, 0.0])


@pytest.fixture(scope="package")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    service = RunningService(tmp_path_factory.mktemp("service") / "data", CUSP_JOBS="1")
    yield service
    took = service.stop()
    assert took < 10, f"the service took {took} s to stop"


@pytest.fixture(scope="package")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("Chromium is not installed (apt-get install chromium)")
    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield opened
        opened.close()


@pytest.fixture(scope="package")
def registered(running: RunningService, design: Path, scan: Path) -> Job:
    """A finished registration, for the tests that only look."""
    options = {**QUICK, "label": "finished"}
    options |= {"tolerance_mm": TOLERANCE_MM, "scan_accuracy_mm": 0.02}
    return running.successful(running.client.submit(design, scan, options).id)


@pytest.fixture(scope="package")
def symmetric(running: RunningService, tmp_path_factory: pytest.TempPathFactory) -> Job:
    """A brick on itself: it fits in four ways."""
    brick = trimesh.creation.box(extents=(30.0, 20.0, 10.0))
    for _ in range(3):
        brick = brick.subdivide()
    path = tmp_path_factory.mktemp("brick") / "brick.stl"
    brick.export(path)
    return running.successful(running.client.submit(path, path, {**QUICK, "label": "brick"}).id)


@pytest.fixture(scope="package")
def marked(running: RunningService, design: Path) -> Job:
    """A finished landmarks job."""
    given = {"type": "landmarks", "options": json.dumps(QUICK)}
    files = {"mesh": ("part.stl", design.read_bytes())}
    answer = httpx.post(f"{running.client.server}/v1/jobs", data=given, files=files)
    return running.successful(answer.json()["id"])


@pytest.fixture
def watched(browser: Browser, running: RunningService) -> Iterator[Watched]:
    context = browser.new_context(viewport={"width": 1100, "height": 900}, reduced_motion="reduce")
    made = Watched(context, running.client.server)
    yield made
    context.close()
    assert made.hosts <= {running.client.server.split("//")[1]}, "a request left the machine"
    assert made.complaints == []
