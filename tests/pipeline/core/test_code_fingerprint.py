"""The fingerprint follows the sources and the library versions, and nothing else."""

import subprocess
import sys
from pathlib import Path

import pipeline
from pipeline.core.code_fingerprint import fingerprint_of


def _package(folder: Path, source: str = "A = 1\n") -> Path:
    (folder / "inner").mkdir(parents=True)
    (folder / "a.py").write_text(source)
    (folder / "inner" / "core.so").write_bytes(b"\x7fELF")
    return folder


def test_fingerprint_is_a_sha256_and_the_same_in_every_process() -> None:
    program = "import pipeline; print(pipeline.code_fingerprint())"
    printed = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    ).stdout
    assert printed.strip() == pipeline.code_fingerprint()
    assert len(bytes.fromhex(pipeline.code_fingerprint())) == 32


def test_sources_and_versions_change_it_but_the_location_and_caches_do_not(tmp_path: Path) -> None:
    first = _package(tmp_path / "first")
    base = fingerprint_of([first], {"numpy": "2.0"})
    assert fingerprint_of([_package(tmp_path / "elsewhere")], {"numpy": "2.0"}) == base
    assert fingerprint_of([_package(tmp_path / "edited", "A = 2\n")], {"numpy": "2.0"}) != base
    assert fingerprint_of([first], {"numpy": "2.1"}) != base
    (first / "__pycache__").mkdir()
    (first / "__pycache__" / "a.cpython-311.pyc").write_bytes(b"cache")
    assert fingerprint_of([first], {"numpy": "2.0"}) == base
    (first / "inner" / "core.so").write_bytes(b"\x7fELF2")
    assert fingerprint_of([first], {"numpy": "2.0"}) != base


def test_a_renamed_file_changes_it(tmp_path: Path) -> None:
    package = _package(tmp_path / "package")
    base = fingerprint_of([package], {})
    (package / "a.py").rename(package / "b.py")
    assert fingerprint_of([package], {}) != base
