"""What the child process asks of the pipeline."""

from pathlib import Path
from typing import Any

import pytest

import pipeline
from service.execution import child


def test_a_registration_is_called_with_everything_of_its_task(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: dict[str, Any] = {}
    monkeypatch.setattr(
        pipeline, "register", lambda design, scan, **given: seen.update(given, meshes=(design, scan))
    )
    mesh = {"path": str(tmp_path / "a.mesh"), "filename": "a.stl", "unit": "mm"}
    own = {"tolerance_mm": 0.2, "scan_accuracy_mm": 0.03, "design_cache": str(tmp_path / "d.npz")}
    task = {
        "type": "registration",
        "design": mesh,
        "scan": mesh,
        "settings": {},
        "seed": 7,
        "out": "out",
        "acceptance": {"tolerance_mm": 0.3},
        "alignment": {"kind": "best_fit"},
        "reference": {"serial": "A-17"},
        **own,
    }
    child.run(task, lambda *_: None)
    assert {name: seen[name] for name in (*own, "seed", "out")} == {**own, "seed": 7, "out": "out"}
    assert seen["alignment"].kind == "best_fit"
    assert (seen["acceptance"].upper, seen["reference"].serial) == (0.3, "A-17")
    assert [each.filename for each in seen["meshes"]] == ["a.stl", "a.stl"]
