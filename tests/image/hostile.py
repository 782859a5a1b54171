"""Hostile jobs in the container, where the service is an ordinary user: `tests/service/execution`."""

import subprocess
import sys
from pathlib import Path

from tests.image.engine import IMAGE, ROOT, Engine

PYTEST = ["-m", "pytest", "-q", "--noconftest", "--config-file=/dev/null", "-p", "no:cacheprovider"]
ATTEMPTS = "/src/tests/service/execution/test_hostile_jobs.py"
VOLUME = "cusp-image-test-hostile"


def hostile_jobs(engine: Engine, folder: Path) -> str:
    """What pytest said of them, in an image that has no pytest: it is mounted."""
    packages = folder / "packages"
    constraints = ROOT / "constraints.txt"
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--target", str(packages)]
    subprocess.run([*install, "--constraint", str(constraints), "pytest"], check=True)
    mounts = [f"--volume={packages}:/packages:ro", f"--volume={ROOT / 'tests'}:/src/tests:ro"]
    engine.run("volume", "rm", "--force", VOLUME, check=False)
    try:
        said = engine.run(
            *("run", "--rm", *engine.no_timer, *engine.hardened, "--network=host", *mounts),
            *(f"--volume={VOLUME}:/data", "--env=PYTHONPATH=/src:/packages", "--entrypoint=python"),
            *(IMAGE, "-P", *PYTEST, "--basetemp=/data/hostile", "-p", "no:dash", ATTEMPTS),
            check=False,
        )
    finally:
        engine.run("volume", "rm", "--force", VOLUME, check=False)
    last = said.splitlines()[-1] if said else "nothing was run"
    if "passed" not in last or any(word in last for word in ("failed", "error", "skipped")):
        raise SystemExit(f"hostile jobs in the container:\n{said}")
    return last
