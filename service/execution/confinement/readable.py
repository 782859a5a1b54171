"""What a job may read beside its own folder: the libraries, fonts, and facts about the machine.

Nothing here holds data of clients or secrets. The interpreter runs with -P, so that the folder in which the
service was started is not among the places of libraries.
"""

import sys
from collections.abc import Iterable
from pathlib import Path

import pipeline
import service

_SYSTEM = ("/usr", "/lib", "/lib64", "/bin", "/opt/cusp", "/nix/store")
_CONFIGURATION = (
    "/etc/ld.so.cache",
    "/etc/ld.so.conf",
    "/etc/ld.so.conf.d",
    "/etc/localtime",
    "/etc/timezone",
    "/etc/fonts",
    "/etc/mime.types",
    "/etc/passwd",  # of the user's home; it holds no passwords
    "/etc/nsswitch.conf",
    "/var/cache/fontconfig",
)
_MACHINE = (
    "/proc/self",
    "/proc/cpuinfo",
    "/proc/meminfo",
    "/proc/stat",
    "/proc/version",
    "/proc/filesystems",
    "/proc/sys/vm",
    "/proc/sys/kernel/cap_last_cap",
    "/sys/devices/system",
    "/sys/fs/cgroup",
    "/dev/urandom",
    "/dev/random",
    "/dev/zero",
)


def libraries() -> list[Path]:
    """Folders and files of programs and libraries."""
    packages = [Path(place) for package in (pipeline, service) for place in package.__path__]
    prefixes = [sys.prefix, sys.exec_prefix, sys.base_prefix, sys.base_exec_prefix]
    places = [*_SYSTEM, *prefixes, *filter(None, sys.path)]
    return [*packages, *(Path(place) for place in places)]


def facts() -> list[Path]:
    """Configuration and facts about the machine."""
    places = [Path(place) for place in (*_CONFIGURATION, *_MACHINE)]
    if (matplotlib := sys.modules.get("matplotlib")) is not None:
        places += [Path(matplotlib.get_cachedir()), Path(matplotlib.get_configdir())]
    return places


def without_parents_of(folder: Path, places: Iterable[Path]) -> list[Path]:
    """Those that do not contain the folder of the job: such a place would hold the folders of others."""
    real = folder.resolve()
    return [place for place in places if not real.is_relative_to(place.resolve())]
