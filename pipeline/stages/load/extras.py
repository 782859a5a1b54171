"""Packages that only some formats need, and what is said where one is not installed."""

from importlib.util import find_spec

from pipeline.core.errors import UnreadableFile

#: Modules by the extra of this package that installs them.
EXTRAS = {"step": ("cascadio",), "las": ("laspy", "lazrs"), "draco": ("DracoPy",)}


def require(extra: str, what: str) -> None:
    """Raise UnreadableFile, with what to install, where a module of an extra is missing.

    what : what is read with it
    """
    missing = [module for module in EXTRAS[extra] if find_spec(module) is None]
    if missing:
        raise UnreadableFile(
            f"to read {what}, this installation lacks the package {' and '.join(missing)}",
            remedy=f"install it with `pip install {' '.join(missing)}` (the extra `{extra}` of Cusp), "
            "or send another format",
        )
