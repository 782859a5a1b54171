"""How XML of a 3MF is parsed, and what is said about XML that cannot be."""

import io
import re
from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from pipeline.core.errors import PipelineError, TruncatedFile, UnreadableFile

#: Options of every parser: nothing is fetched, no entity is expanded, and libxml2's limits of depth and
#: length hold.
OPTIONS: dict[str, Any] = {"resolve_entities": False, "no_network": True, "huge_tree": False}


def not_well_formed(part: str, data: bytes, error: Any) -> PipelineError:
    """The error for a syntax error of lxml in a part: TruncatedFile where it ends early, UnreadableFile
    otherwise.
    """
    line = error.lineno or 1
    if not data.strip():
        return TruncatedFile(f"{part} in the 3MF is empty")
    if not re.search(rb"</[^<>]*>\s*$|/>\s*$", data[-200:]) or "Premature end" in str(error.msg):
        return TruncatedFile(f"{part} in the 3MF ends at line {line}, inside an element")
    reason = re.sub(r",? ?line \d+.*", "", str(error.msg))
    return UnreadableFile(f"{part} in the 3MF, line {line}: the XML is not well-formed ({reason})")


def line_of(data: bytes, name: str, ordinal: int) -> int:
    """The line of the `ordinal`-th element `name` of any namespace, counted from 0; 0 when not found."""
    try:
        events = etree.iterparse(io.BytesIO(data), events=("start",), tag=f"{{*}}{name}", **OPTIONS)
        for number, (_, element) in enumerate(events):
            if number == ordinal:
                return int(element.sourceline or 0)
    except etree.XMLSyntaxError:
        pass
    return 0
