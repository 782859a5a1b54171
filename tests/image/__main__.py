"""Builds the image and runs it as its users would: `make image-test`. Not part of `make test`.

With a Docker engine by that; else by buildah and podman, on a base that debootstrap makes, or on `--base
NAME` of their storage. Then: the container runs as an ordinary user on a read-only root, gets healthy,
registers the demo over HTTP, keeps its jobs over a restart, refuses to listen without keys, and stops cleanly
within ten seconds.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import httpx

from service.client.sync import Client
from tests.support.storage import free_port

ROOT = Path(__file__).parents[2]
IMAGE, BASE, CONTAINER, VOLUME = (
    "localhost/cusp:test",
    "localhost/cusp-base:bookworm",
    "cusp-image-test",
    "cusp-image-test",
)
STARTS_WITHIN_S, STOPS_WITHIN_S = 120, 10
#: podman without systemd: another runtime, and limits that need no privilege.
CONTAINERS_CONF = """[engine]
runtime = "runc"
cgroup_manager = "cgroupfs"
events_logger = "file"
[containers]
default_ulimits = ["nofile=1024:1024", "nproc=4096:4096"]
pids_limit = 0
"""


class Engine:
    """docker, or podman with buildah: the words that both understand."""

    def __init__(self, folder: Path) -> None:
        has_docker = shutil.which("docker") and _works("docker", "info")
        if not has_docker and not (shutil.which("podman") and shutil.which("buildah")):
            raise SystemExit(
                "no container engine: install Docker, or "
                "apt-get install buildah podman debootstrap runc conmon"
            )
        self.command = "docker" if has_docker else "podman"
        self.environment = dict(os.environ)
        self.no_timer: list[str] = []
        if self.command == "podman":
            conf = folder / "containers.conf"
            conf.write_text(CONTAINERS_CONF)
            self.no_timer = ["--no-healthcheck"]  # podman would have systemd run it; `check` runs it itself
            self.environment |= {"CONTAINERS_CONF": str(conf), "BUILDAH_ISOLATION": "chroot"}

    def run(self, *words: str, check: bool = True, program: str | None = None) -> str:
        """What it printed."""
        done = subprocess.run(
            [program or self.command, *words],
            env=self.environment,
            cwd=ROOT,
            text=True,
            stdout=subprocess.PIPE,
            check=check,
        )
        return done.stdout.strip()

    def build(self, base: str | None) -> None:
        """The image, from the Dockerfile as it is."""
        index = os.environ.get("PIP_INDEX_URL")
        given = [f"--build-arg=PIP_INDEX_URL={index}"] if index else []
        if self.command == "docker":
            self.run("build", "--tag", IMAGE, *given, *([f"--build-arg=BASE={base}"] if base else []), ".")
            return
        if base is None:
            base = BASE
            self._debootstrap()
        certificate = os.environ.get("PIP_CERT")
        if certificate:  # not where it is here: a package of the base writes there
            given += [f"--volume={certificate}:/mnt/ca.crt:ro", "--build-arg=PIP_CERT=/mnt/ca.crt"]
        words = ["bud", "--format", "docker", "--tag", IMAGE, f"--build-arg=BASE={base}", *given, "."]
        self.run(*words, program="buildah")

    def _debootstrap(self) -> None:
        if _works(self.command, "image", "exists", BASE):
            return
        with tempfile.TemporaryDirectory() as folder:
            root = f"{folder}/root"
            subprocess.run(
                ["debootstrap", "--variant=minbase", "bookworm", root], check=True, stdout=subprocess.DEVNULL
            )
            packed = f"{folder}/root.tar"
            subprocess.run(["tar", "-C", root, "-cf", packed, "."], check=True)
            self.run("import", packed, BASE)


def _works(*words: str) -> bool:
    return subprocess.run(words, capture_output=True).returncode == 0


def start(engine: Engine, port: int) -> None:
    """As the compose file does, but on the host's network: it needs no privilege to set one up."""
    hardened = ["--read-only", "--tmpfs=/tmp", "--cap-drop=ALL", "--security-opt=no-new-privileges"]
    where = [
        "--network=host",
        f"--env=CUSP_PORT={port}",
        "--env=CUSP_HOST=127.0.0.1",
        f"--volume={VOLUME}:/data",
    ]
    engine.run("run", "--detach", "--name", CONTAINER, *engine.no_timer, *hardened, *where, IMAGE)


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
        not _works(engine.command, "exec", CONTAINER, "sh", "-c", "touch /opt/x 2>/dev/null"),
        "the root can be written",
    )
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
            print(f"built by {engine.command} in {time.monotonic() - begun:.0f} s", flush=True)
        engine.run("rm", "--force", CONTAINER, check=False)
        engine.run("volume", "rm", "--force", VOLUME, check=False)
        try:
            for what, words in check(engine, Path(folder)).items():
                print(f"{what}: {words}")
        except httpx.HTTPError as error:
            sys.exit(f"the container does not answer: {error}")
        finally:
            engine.run("rm", "--force", CONTAINER, check=False)
            engine.run("volume", "rm", "--force", VOLUME, check=False)


if __name__ == "__main__":
    main()
