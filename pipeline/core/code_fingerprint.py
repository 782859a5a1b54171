"""A hash of the code that computes. Cached results are reused by the same code and libraries only."""

import functools
import hashlib
import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

SUFFIXES = (".py", ".so")
#: Distributions whose version may change a result.
LIBRARIES = (
    "numpy",
    "scipy",
    "open3d-cpu",
    "pymeshlab",
    "trimesh",
    "fast-simplification",
    "scikit-learn",
)
#: The same, of the packages that read some formats, where they are installed.
FORMAT_LIBRARIES = ("cascadio", "laspy", "lazrs", "dracopy")


@functools.cache
def code_fingerprint() -> str:
    """SHA-256 (64 hex digits) of the installed package `pipeline` and its libraries' versions.

    Computed once per process. Imports none of the libraries.
    """
    return fingerprint_of(_package_folders(), versions_of(LIBRARIES) | versions_of_formats())


def versions_of(names: tuple[str, ...]) -> dict[str, str]:
    """Versions of distributions that are installed."""
    return {name: version(name) for name in names}


def versions_of_formats() -> dict[str, str]:
    """Versions of those of `FORMAT_LIBRARIES` that are installed."""
    found = {}
    for name in FORMAT_LIBRARIES:
        with suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def fingerprint_of(folders: list[Path], versions: dict[str, str]) -> str:
    """Hash the relative path and content of every source file below `folders`, then the versions.

    The order of `folders` and of `versions` does not matter.
    """
    digest = hashlib.sha256()
    files = {
        path.relative_to(folder).as_posix(): path
        for folder in folders
        for path in folder.rglob("*")
        if path.suffix in SUFFIXES
    }
    for name, path in sorted(files.items()):
        digest.update(f"{name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    for name, number in sorted(versions.items()):
        digest.update(f"{name}=={number}\n".encode())
    return digest.hexdigest()


def _package_folders() -> list[Path]:
    """The sources, and with an editable install the folder of the compiled extension as well."""
    package = sys.modules[__name__.partition(".")[0]]
    folders = {Path(folder).resolve() for folder in package.__path__}
    return sorted(folder for folder in folders if folder.is_dir())
