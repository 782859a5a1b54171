"""A printer drifts: 30 prints of one part in a batch, and those that left the tolerance fail."""

import csv
import io
import json
from pathlib import Path

import aqdefreader
import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from tests.support import shapes
from tests.support.running import RunningService
from tests.support.scans import save
from tests.support.settings import FAST

pytestmark = pytest.mark.e2e

PARTS, DRIFT, TOLERANCE_MM = 30, 0.0006, 0.2
SETTINGS = {**FAST, "report": {"content": "light", "qdas": True}}


def printed(number: int) -> Mesh:
    """Smaller from part to part, on another triangulation than the design, lying anywhere."""
    part = shapes.bumpy_blob(4, triangulation=1 + number % 3)
    return Mesh((1 - DRIFT * number) * part.vertices, part.faces).moved(shapes.motion(number))


def deviation_mm(number: int) -> float:
    """How far the surface of a part lies within the design where it does most: its shrink times the distance
    of the tangent plane from the middle.
    """
    design = shapes.bumpy_blob(4)
    normals = design.vertex_normals()
    middle = np.average(design.vertices, axis=0, weights=design.vertex_areas_mm2())
    return DRIFT * number * float(np.einsum("kd,kd->k", design.vertices - middle, normals).max())


@pytest.mark.nightly
def test_the_parts_of_a_drifting_printer_that_left_the_tolerance_fail(
    running: RunningService, tmp_path: Path
) -> None:
    client = running.client
    design = client.put_blob(save(shapes.bumpy_blob(4), tmp_path / "design.stl"))
    limits = {"tolerance_mm": TOLERANCE_MM, "min_coverage": 0.9, "patch_mm": 4.0}
    region = {"kind": "box", "min_mm": [-60, -60, -60], "max_mm": [60, 60, 60]}
    client.put_characteristics(
        design,
        {
            "regions": [{"name": "all", "region": region}],
            "acceptance": limits,
            "alignment": {"kind": "best_fit", "regions": [{"region": {"kind": "named", "name": "all"}}]},
        },
    )
    scans = [
        {
            "scan": save(printed(number), tmp_path / f"{number}.ply"),
            "reference": {"serial": f"P-{number:02}", "measured_at": f"2026-11-27T10:{number:02}:00"},
            "label": f"part {number}",
        }
        for number in range(PARTS)
    ]
    reference = {"part_number": "BLOB", "batch": "drift"}
    made = client.submit_batch(design, scans, batch_label="drift", settings=SETTINGS, reference=reference)
    done = client.wait_batch(made.id, timeout_s=3600)
    assert done.by_status == {"successful": PARTS}
    table = list(csv.DictReader(io.StringIO(client.batch_table(made.id))))
    assert [line["serial"] for line in table] == [f"P-{number:02}" for number in range(PARTS)]
    decisions = [line["decision"] for line in table]
    good = [number for number in range(PARTS) if deviation_mm(number) < 0.7 * TOLERANCE_MM]
    bad = [number for number in range(PARTS) if deviation_mm(number) > 1.5 * TOLERANCE_MM]
    assert (len(good) >= 5, len(bad) >= 5) == (True, True)
    assert {decisions[number] for number in good} == {"pass"}, decisions
    assert {decisions[number] for number in bad} == {"fail"}, decisions
    assert set(decisions) == {"pass", "fail"}  # between the two, the triangles of the scan decide
    assert done.by_decision == {name: decisions.count(name) for name in ("fail", "pass")}
    last = table[-1]["job"]
    result = client.results(last)
    assert (result["alignment"]["kind"], result["alignment"]["applied"]) == ("best_fit", True)
    client.download(last, "characteristics.dfq", tmp_path / "last.dfq")
    lines = (tmp_path / "last.dfq").read_bytes().decode("utf-8-sig").splitlines()
    part = aqdefreader.DfqFile(lines).get_part(0)
    names = {part.get_characteristic_by_index(k).get_data("K2002"): k for k in range(1, 4)}
    (value,) = part.get_characteristic_by_index(names["lowest"]).get_measurements()
    checks = {check["name"]: check for check in result["inspection"]["checks"]}
    assert float(value.value) == pytest.approx(checks["lowest"]["value"], abs=1e-9)
    assert json.dumps(result["reference"]).count("P-29") == 1
