"""What the image is built from: the versions that are tested, each file with a hash, none with a known
vulnerability.
"""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
LOCKS = [ROOT / "image" / "requirements.lock", ROOT / "image" / "build.lock"]
SERVERS = ("postgres", "store", "bucket")  # of docker-compose.yml
PIN = re.compile(r"^([A-Za-z0-9_.-]+)==([^\s;\\]+)", re.MULTILINE)


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_every_package_has_a_hash_and_the_version_that_is_tested(lock: Path) -> None:
    """`make lock` writes it from constraints.txt."""
    text = lock.read_text()
    tested = {(name, version) for name, version in PIN.findall((ROOT / "constraints.txt").read_text())}
    entries = re.split(r"\n(?=[A-Za-z0-9])", text)
    assert all("--hash=sha256:" in entry for entry in entries)
    pins = set(PIN.findall(text))
    known = {name for name, _ in tested}
    assert pins, "an empty lock"
    assert {(name, version) for name, version in pins if name in known} <= tested


def test_the_image_has_every_library_of_the_project() -> None:
    locked = {name for name, _ in PIN.findall(LOCKS[0].read_text())}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["formats"]]
    assert {re.split(r"[\[<>= ]", name)[0].lower() for name in wanted} <= locked


def test_the_compose_file_holds_no_password() -> None:
    """Nothing that a client could guess: passwords come from files that `make secrets` writes."""
    text = (ROOT / "docker-compose.yml").read_text()
    assert not re.search(r"(PASSWORD|SECRET)\w*:", text)
    services = yaml.safe_load(text)["services"]
    for name in ("api", "worker", "postgres", "store", "bucket"):
        assert services[name]["env_file"] == [f"secrets/{name if name in SERVERS else 'service'}.env"]
    assert "env_file" not in services["cusp"]


def test_images_have_exact_tags() -> None:
    compose = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
    base = re.search(r"^ARG BASE=(.+)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    assert base is not None
    for image in [base[1], *(each["image"] for each in compose["services"].values())]:
        if image != "cusp:local":
            assert re.search(r":.*\d{2,}.*|@sha256:", image), f"{image} can change"


def test_secrets_are_made_once_and_for_the_owner_only(tmp_path: Path) -> None:
    script = tmp_path / "image" / "secrets.sh"
    script.parent.mkdir()
    script.write_bytes((ROOT / "image" / "secrets.sh").read_bytes())
    subprocess.run(["sh", script], check=True)
    made = {path.name: path.read_text() for path in (tmp_path / "secrets").iterdir()}
    assert set(made) == {"service.env", "postgres.env", "store.env", "bucket.env"}
    password = made["postgres.env"].strip().split("=")[1]
    assert len(password) == 48 and f"cusp:{password}@postgres" in made["service.env"]
    assert all(path.stat().st_mode & 0o077 == 0 for path in (tmp_path / "secrets").iterdir())
    subprocess.run(["sh", script], check=True)
    assert {path.name: path.read_text() for path in (tmp_path / "secrets").iterdir()} == made


@pytest.mark.nightly
def test_a_bill_of_materials_lists_what_is_locked(tmp_path: Path) -> None:
    """CycloneDX, checked against its schema; `make sbom` writes it."""
    made = tmp_path / "sbom.json"
    command = [sys.executable, "-m", "cyclonedx_py", "requirements", str(LOCKS[0])]
    subprocess.run([*command, "--output-reproducible", "--validate", "-o", str(made)], check=True)
    bill = json.loads(made.read_text())
    assert bill["bomFormat"] == "CycloneDX"
    listed = {(each["name"].lower(), each["version"]) for each in bill["components"]}
    assert listed == set(PIN.findall(LOCKS[0].read_text()))


@pytest.mark.nightly
def test_no_known_vulnerability() -> None:
    """Skipped where the index that pip uses publishes no advisories."""
    command = [sys.executable, "-m", "pip_audit", "--require-hashes", "--disable-pip", "--format", "json"]
    done = subprocess.run(
        [*command, "--progress-spinner", "off", "-r", str(LOCKS[0])], capture_output=True, text=True
    )
    assert done.stdout, done.stderr
    packages = json.loads(done.stdout)["dependencies"]
    if all("skip_reason" in each for each in packages):
        pytest.skip("no advisories can be had from here")
    assert {each["name"]: each["vulns"] for each in packages if each.get("vulns")} == {}
