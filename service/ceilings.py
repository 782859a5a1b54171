"""Ceilings of the operator: how far clients may raise the settings of a job that guard this machine.

The bounds in the settings themselves are what the method can do; these are what one installation allows.
"""

import re
from typing import Any

from pydantic import BaseModel

from pipeline import Settings

_WORD = re.compile(r"\s*([a-z_]+\.[a-z_]+)\s*=\s*([0-9][0-9_.eE+]*)\s*")
#: The guards of the load stage stay as they are, unless the operator raises them.
GUARDS = ("load.max_faces", "load.max_points", "load.max_archive_expansion")


def read_ceilings(text: str) -> dict[str, float]:
    """Ceilings by setting (`section.name`): those of `text` (`load.max_faces=1e7, ...`) over the defaults.

    Raises ValueError for what is no number of the settings, and for a ceiling below what jobs use by default.
    """
    ceilings = {name: setting_value(Settings(), name) for name in GUARDS}
    for word in filter(None, (each.strip() for each in text.split(","))):
        match = _WORD.fullmatch(word)
        if match is None:
            raise ValueError(f"{word!r} is not of the form section.name=number")
        name, ceiling = match[1], float(match[2])
        for preset in ("default", "paper"):
            used = setting_value(Settings.preset(preset), name)
            if used is not None and ceiling < used:
                raise ValueError(f"{name}={match[2]} is below {used:g}, which jobs use by default")
        ceilings[name] = ceiling
    return {name: ceiling for name, ceiling in ceilings.items() if ceiling is not None}


def setting_value(settings: Settings, name: str) -> Any:
    """The number of a setting; None where it is null. Raises ValueError if there is no such number."""
    section, _, field = name.partition(".")
    within = getattr(settings, section, None)
    if not isinstance(within, BaseModel) or field not in type(within).model_fields:
        raise ValueError(f"there is no setting {name}")
    value = getattr(within, field)
    if isinstance(value, bool) or not isinstance(value, int | float | None):
        raise ValueError(f"the setting {name} is no number")
    return value
