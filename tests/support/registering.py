"""`pipeline.register` for tests that do not judge the design's part: a design is analysed once a process."""

import atexit
import hashlib
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import pipeline
from pipeline import MeshFile, RegistrationResult, Settings


@cache
def _folder() -> Path:
    """Of analyses of designs; gone with the process."""
    folder = tempfile.mkdtemp(prefix="cusp-designs-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


def register(
    design: Path, scan: Path | MeshFile, *, settings: Settings | None = None, seed: int = 0, **given: Any
) -> RegistrationResult:
    """As `pipeline.register`, which gives the same with a kept design
    (`tests/pipeline/analysis/test_design_model.py`).
    """
    made_of = design.read_bytes() + (settings or Settings()).model_dump_json().encode() + str(seed).encode()
    kept = _folder() / f"{hashlib.sha256(made_of).hexdigest()}.npz"
    return pipeline.register(design, scan, settings=settings, seed=seed, design_cache=kept, **given)
