"""The compose file: its default profile, and `scale` with test servers in the places of images that cannot be
had.
"""

import re
import subprocess
import sys
import time
from pathlib import Path

from service.client.sync import Client
from tests.image.engine import ROOT, Engine
from tests.support.storage import free_port

READY_WITHIN_S = 120
SERVERS_FILE = "tests/image/compose.servers.yml"


def default_profile(engine: Engine, folder: Path) -> str:
    """Started by the one command of the README; the demo goes through it."""
    port = free_port()
    words = ["-p", "cusp-test-default", "-f", "docker-compose.yml"]
    try:
        engine.run_compose(*words, "up", "-d", "--no-build", CUSP_PORT=str(port))
        return _register_demo(f"http://127.0.0.1:{port}", folder / "default")
    finally:
        engine.run_compose(
            *words,
            "down",
            "--volumes",
            "--remove-orphans",
            "--timeout",
            "20",
            check=False,
            CUSP_PORT=str(port),
        )


def scale_profile(engine: Engine, folder: Path) -> str:
    """An API and two workers, with passwords that `make secrets` made."""
    subprocess.run([ROOT / "image" / "secrets.sh"], check=True, stdout=subprocess.DEVNULL)
    port = str(free_port())
    words = ["-p", "cusp-test-scale", "-f", "docker-compose.yml"]
    words += ["-f", SERVERS_FILE, "--profile", "scale"] if engine.command == "podman" else []
    try:
        if engine.command == "podman":  # it has no health checks to wait for
            engine.run_compose(*words, "up", "-d", "--no-build", "postgres", "bucket", CUSP_API_PORT=port)
            name = engine.run("ps", "--quiet", "--filter", "name=cusp-test-scale_postgres")
            _until(lambda: engine.run("exec", name, "sh", "-c", "ls /tmp/.s.PGSQL.5432", check=False) != "")
        up = ["up", "-d", "--no-build", "--scale", "worker=2", "api", "worker"]
        engine.run_compose(*words, *up, CUSP_API_PORT=port)
        return _register_demo(f"http://127.0.0.1:{port}", folder / "scale")
    finally:
        engine.run_compose(
            *words,
            "down",
            "--volumes",
            "--remove-orphans",
            "--timeout",
            "20",
            check=False,
            CUSP_API_PORT=port,
        )


def _register_demo(server: str, out: Path) -> str:
    client = Client(server)
    took = _until(client.is_ready)
    command = [sys.executable, "-m", "service.cli.main", "demo", "--server", server, "--out", str(out)]
    told = subprocess.run(command, capture_output=True, text=True)
    found = re.search(r"/v1/jobs/([0-9a-f-]{36})/results", told.stdout)
    if told.returncode != 0 or found is None:
        raise SystemExit(f"the demo failed:\n{told.stdout}\n{told.stderr}")
    verdict = client.results(found[1])["verdict"]
    return f"ready after {took:.0f} s; demo {verdict['status']}, confidence {verdict['confidence']:.2f}"


def _until(condition: object) -> float:
    """Seconds until it was true."""
    assert callable(condition)
    begun = time.monotonic()
    while not condition():
        if time.monotonic() - begun > READY_WITHIN_S:
            raise SystemExit(f"not ready after {READY_WITHIN_S} s; see the logs of the containers")
        time.sleep(0.2)
    return time.monotonic() - begun
