"""Docker, or podman with buildah: the words that both understand, and the compose command of either."""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
IMAGE, BASE, SERVERS = "localhost/cusp:test", "localhost/cusp-base:bookworm", "localhost/cusp-servers:test"
#: What docker-compose.yml calls it.
COMPOSE_IMAGE = "localhost/cusp:local"
#: podman without systemd: another runtime, and limits that need no privilege.
CONTAINERS_CONF = """[engine]
runtime = "runc"
cgroup_manager = "cgroupfs"
events_logger = "file"
[containers]
default_ulimits = ["nofile=1024:1024", "nproc=4096:4096"]
pids_limit = 0
"""
#: As the official slim images leave it out.
NOT_IN_A_BASE = (
    "var/cache/apt",
    "var/lib/apt/lists",
    "usr/share/man",
    "usr/share/info",
    "usr/share/locale",
)


class Engine:
    """folder : for its configuration"""

    def __init__(self, folder: Path) -> None:
        has_docker = shutil.which("docker") and works("docker", "info")
        if not has_docker and not (shutil.which("podman") and shutil.which("buildah")):
            raise SystemExit(
                "no container engine: install Docker, or apt-get install buildah podman debootstrap runc "
                "conmon netavark aardvark-dns catatonit"
            )
        self.command = "docker" if has_docker else "podman"
        self.environment = dict(os.environ)
        self.no_timer: list[str] = []
        #: As the compose file has it.
        self.hardened = [
            "--read-only",
            "--tmpfs=/tmp",
            "--cap-drop=ALL",
            "--security-opt=no-new-privileges",
        ]
        self.compose = ["docker", "compose"]
        if self.command == "podman":
            conf = folder / "containers.conf"
            conf.write_text(CONTAINERS_CONF)
            self.no_timer = ["--no-healthcheck"]  # podman would have systemd run it; `check` runs it itself
            self.compose = [sys.executable, "-m", "podman_compose"]
            self.environment |= {"CONTAINERS_CONF": str(conf), "BUILDAH_ISOLATION": "chroot"}

    def run(self, *words: str, check: bool = True, program: str | None = None) -> str:
        """What it printed."""
        return self._run([program or self.command, *words], check=check)

    def run_compose(self, *words: str, check: bool = True, **variables: str) -> str:
        """The same of the compose command. variables : for the compose file"""
        return self._run([*self.compose, *words], check=check, **variables)

    def _run(self, words: list[str], *, check: bool, **variables: str) -> str:
        done = subprocess.run(
            words,
            env={**self.environment, **variables},
            cwd=ROOT,
            text=True,
            capture_output=True,
        )
        if check and done.returncode != 0:
            raise SystemExit(f"{' '.join(words)}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}")
        return done.stdout.strip()

    def build(self, base: str | None) -> None:
        """The image, from the Dockerfile as it is."""
        if base is None and self.command == "podman":
            base = BASE
            self._debootstrap()
        self._build(IMAGE, ROOT / "Dockerfile", ROOT, base)
        self.run("tag", IMAGE, COMPOSE_IMAGE)

    def build_servers(self, base: str | None) -> None:
        """PostgreSQL and the S3 server of the tests, in an image. By buildah: Docker gets the real ones."""
        folder = Path(__file__).parent
        constraints = f"--volume={ROOT / 'constraints.txt'}:/mnt/constraints.txt:ro"  # outside of the context
        self._build(SERVERS, folder / "servers.Dockerfile", folder, base or BASE, constraints)

    def _build(self, image: str, file: Path, context: Path, base: str | None, *options: str) -> None:
        index, certificate = os.environ.get("PIP_INDEX_URL"), os.environ.get("PIP_CERT")
        given = [f"--build-arg=PIP_INDEX_URL={index}"] if index else []
        given += [f"--build-arg=BASE={base}"] if base else []
        if self.command == "docker":
            self.run("build", "--tag", image, "--file", str(file), *given, str(context))
            return
        if certificate:  # not where it is here: a package of the base writes there
            given += [f"--volume={certificate}:/mnt/ca.crt:ro", "--build-arg=PIP_CERT=/mnt/ca.crt"]
        words = ["bud", "--layers", "--format=docker", f"--tag={image}", f"--file={file}", *given, *options]
        self.run(*words, str(context), program="buildah")

    def _debootstrap(self) -> None:
        if works(self.command, "image", "exists", BASE):
            return
        with tempfile.TemporaryDirectory() as folder:
            root = f"{folder}/root"
            subprocess.run(
                ["debootstrap", "--variant=minbase", "bookworm", root], check=True, stdout=subprocess.DEVNULL
            )
            packed = f"{folder}/root.tar"
            left_out = [f"--exclude=./{place}/*" for place in NOT_IN_A_BASE]
            subprocess.run(["tar", "-C", root, *left_out, "-cf", packed, "."], check=True)
            self.run("import", packed, BASE)


def works(*words: str) -> bool:
    """True if the command ends with 0."""
    return subprocess.run(words, capture_output=True).returncode == 0
