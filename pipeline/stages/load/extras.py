"""Packages that only some formats need, and what is said where one is not installed."""

from importlib.util import find_spec

from pipeline.core.errors import UnreadableFile
from pipeline.core.formats import Format

#: Packages that read a format, and the extra of this package that installs them.
EXTRAS: dict[Format, tuple[tuple[str, ...], str]] = {
    Format.STEP: (("cascadio",), "step"),
    Format.LAS: (("laspy", "lazrs"), "las"),
}


def require(kind: Format) -> None:
    """Raise UnreadableFile, with what to install, where a package for the format is missing."""
    packages, extra = EXTRAS[kind]
    missing = [package for package in packages if find_spec(package) is None]
    if missing:
        raise UnreadableFile(
            f"to read {kind.upper()}, this installation lacks the package {' and '.join(missing)}",
            remedy=f"install it with `pip install cusp[{extra}]`, or send another format",
        )
