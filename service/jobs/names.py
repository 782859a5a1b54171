"""The names of a job in one text, so that a list can be searched by a part of any of them."""

from collections.abc import Mapping
from typing import Any

from sqlalchemy.engine.default import DefaultExecutionContext

#: Longest text, in characters: PostgreSQL's index takes 2,704 bytes a row, and a character has up to 4.
MAX_NAMES = 600


def names_of(label: str | None, inputs: Mapping[str, Any], reference: Mapping[str, Any]) -> str | None:
    """Label, file names, part number, serial number and batch, a line each, without capitals; None without
    any.
    """
    files = [source.get("filename") for source in inputs.values() if isinstance(source, dict)]
    keys = [reference.get(key) for key in ("part_number", "serial", "batch")]
    text = "\n".join(str(each) for each in (label, *keys, *files) if each)
    return text.lower()[:MAX_NAMES] or None


def names_of_new_row(context: DefaultExecutionContext) -> str | None:
    """The same of a row that is being inserted."""
    row: dict[str, Any] = context.get_current_parameters()  # type: ignore[no-untyped-call]
    return names_of(
        row.get("label"), row.get("inputs") or {}, (row.get("options") or {}).get("reference") or {}
    )
