"""Builds the image and runs it as its users would: `make image-test`. Not part of `make test`.

With a Docker engine by that; else by buildah and podman, on a base that debootstrap makes, or on `--base
NAME` of their storage. Then: the container runs as an ordinary user on a read-only root, gets healthy,
registers the demo over HTTP, keeps its jobs over a restart, refuses to listen without keys, and stops cleanly
within ten seconds. Jobs are confined completely: /version says so, and hostile jobs reach nothing. The demo
also goes through the compose file: its default profile, and `scale` with the servers of the tests. Last it
prints what is in the image.
"""

import argparse
import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx

from service.client.sync import Client
from tests.image.compose import default_profile, scale_profile
from tests.image.engine import IMAGE, Engine, works
from tests.image.hostile import hostile_jobs
from tests.support.storage import free_port

CONTAINER, VOLUME = "cusp-image-test", "cusp-image-test"
STARTS_WITHIN_S, STOPS_WITHIN_S = 120, 10
MAX_GB = 1.6
SIZES = "du -sm /opt/cusp/lib/python3*/site-packages/* /usr | sort -rn | head -12"


def start(engine: Engine, port: int) -> None:
    """As the compose file does, but on the host's network: it needs no privilege to set one up."""
    where = [
        "--network=host",
        f"--env=CUSP_PORT={port}",
        "--env=CUSP_HOST=127.0.0.1",
        f"--volume={VOLUME}:/data",
    ]
    engine.run("run", "--detach", "--name", CONTAINER, *engine.no_timer, *engine.hardened, *where, IMAGE)


def wait_ready(engine: Engine, client: Client) -> float:
    """Seconds until the service took jobs."""
    begun = time.monotonic()
    while not client.is_ready():
        running = engine.run("inspect", "--format", "{{.State.Running}}", CONTAINER) == "true"
        if not running or time.monotonic() - begun > STARTS_WITHIN_S:
            raise SystemExit(
                f"the container does not get ready:\n{engine.run('logs', CONTAINER, check=False)}"
            )
        time.sleep(0.1)
    return time.monotonic() - begun


def check(engine: Engine, folder: Path) -> dict[str, str]:
    """Everything, and what was seen."""
    seen: dict[str, str] = {}
    port = free_port()
    client = Client(f"http://127.0.0.1:{port}")
    refused = subprocess.run(
        [engine.command, "run", "--rm", *engine.no_timer, "--network=host", IMAGE],
        env=engine.environment,
        capture_output=True,
        text=True,
    )
    _expect(refused.returncode == 1 and "there are no API keys" in refused.stderr, f"not refused: {refused}")
    seen["without keys on 0.0.0.0"] = "refused: " + refused.stderr.strip()[:60] + "..."

    start(engine, port)
    seen["ready after"] = f"{wait_ready(engine, client):.1f} s"
    users = set(engine.run("exec", CONTAINER, "sh", "-c", "cat /proc/[0-9]*/status | grep ^Uid").split("\n"))
    _expect({line.split()[1] for line in users} == {"10001"}, f"other users: {users}")
    _expect(engine.run("exec", CONTAINER, "id", "-u") == "10001", "another user")
    _expect(
        not works(engine.command, "exec", CONTAINER, "sh", "-c", "touch /opt/x 2>/dev/null"),
        "the root can be written",
    )
    sandbox = httpx.get(f"{client.server}/version").json()["sandbox"]
    _expect(not sandbox["missing"], f"jobs are not confined: {sandbox}")
    seen["sandbox, by /version"] = f"Landlock {sandbox['landlock']}, system calls filtered"
    seen["user"] = "10001 in every process; root file system read-only"
    (image,) = json.loads(engine.run("image", "inspect", IMAGE))
    command = (image.get("Healthcheck") or image["Config"]["Healthcheck"])["Test"]
    _expect(command[0] == "CMD", f"no health check: {command}")
    engine.run("exec", CONTAINER, *command[1:])  # podman needs systemd to run it by itself
    seen["health check"] = "passes"

    for path in ("/", "/web/app.js", "/web/vendor/three/three.module.js"):
        _expect(httpx.get(client.server + path).status_code == 200, f"no {path} in the image")
    demo = [
        sys.executable,
        "-m",
        "service.cli.main",
        "demo",
        "--server",
        client.server,
        "--out",
        str(folder / "demo"),
    ]
    told = subprocess.run(demo, capture_output=True, text=True)
    found = re.search(r"/v1/jobs/([0-9a-f-]{36})/results", told.stdout)
    if told.returncode != 0 or found is None:
        raise SystemExit(f"the demo failed:\n{told.stdout}\n{told.stderr}")
    job = client.job(found[1])
    verdict = client.results(job.id)["verdict"]
    seen["demo over HTTP"] = f"{verdict['status']}, confidence {verdict['confidence']:.2f}"

    begun = time.monotonic()
    engine.run("stop", "--time=30", CONTAINER)
    took = time.monotonic() - begun
    code = engine.run("inspect", "--format", "{{.State.ExitCode}}", CONTAINER)
    _expect(took < STOPS_WITHIN_S and code == "0", f"stopped after {took:.1f} s with exit code {code}")
    seen["SIGTERM to pid 1"] = f"ended in {took:.1f} s with exit code 0"
    engine.run("start", CONTAINER)
    wait_ready(engine, client)
    _expect(client.job(job.id).status.value == "successful", "the job is gone after a restart")
    seen["after a restart"] = "the job is there"
    size = int(engine.run("image", "inspect", "--format", "{{.Size}}", IMAGE))
    seen["size of the image"] = f"{size / 1e9:.2f} GB"
    _expect(size <= MAX_GB * 1e9, f"the image has {size / 1e9:.2f} GB, more than {MAX_GB}")
    bill = json.loads(engine.run("exec", CONTAINER, "cat", "/opt/cusp/sbom.cdx.json"))
    seen["packages in its bill of materials"] = str(len(bill["components"]))
    seen["largest parts, MB"] = engine.run("exec", CONTAINER, "sh", "-c", SIZES).replace("/opt/cusp/lib/", "")
    return seen


def _expect(is_true: bool, words: str) -> None:
    if not is_true:
        raise SystemExit(words)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--base", help="base image instead of the Dockerfile's or debootstrap's")
    parser.add_argument("--skip-build", action="store_true", help="test the image that is there")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        engine = Engine(Path(folder))
        begun = time.monotonic()
        if not options.skip_build:
            engine.build(options.base)
            if engine.command == "podman":
                engine.build_servers(options.base)
            print(f"built by {engine.command} in {time.monotonic() - begun:.0f} s", flush=True)
        engine.run("rm", "--force", CONTAINER, check=False)
        engine.run("volume", "rm", "--force", VOLUME, check=False)
        try:
            for what, words in check(engine, Path(folder)).items():
                print(f"{what}: {words}", flush=True)
            print(f"hostile jobs as user 10001: {hostile_jobs(engine, Path(folder))}", flush=True)
            print(f"compose, default profile: {default_profile(engine, Path(folder))}", flush=True)
            print(f"compose, scale profile: {scale_profile(engine, Path(folder))}", flush=True)
        except httpx.HTTPError as error:
            sys.exit(f"the container does not answer: {error}")
        finally:
            engine.run("rm", "--force", CONTAINER, check=False)
            engine.run("volume", "rm", "--force", VOLUME, check=False)


if __name__ == "__main__":
    main()
