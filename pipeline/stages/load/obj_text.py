"""The text of a Wavefront OBJ made plain: continued lines, decimal commas, comments."""

import re

from pipeline.core.formats import Format
from pipeline.stages.load.text_words import ambiguous_comma, is_decimal_comma

_VERTEX_COMMA = re.compile(rb"^[^\S\n]*v[^\S\n][^\n#,]*,", re.MULTILINE)
_VERTEX_LINE = re.compile(rb"^[^\S\n]*v[^\S\n][^\n]*", re.MULTILINE)
_WITH_INDICES = (b"v", b"f", b"fo", b"p", b"l")


def with_joined_lines(data: bytes) -> bytes:
    """Lines that a backslash continues as one, followed by as many empty lines: the numbers of lines stay.

    A comment is not continued: `# C:\\parts\\` is one.
    """
    if re.search(rb"\\[^\S\n]*\n", data) is None:
        return data
    done: list[bytes] = []
    open_lines: list[bytes] = []
    for line in data.split(b"\n"):
        bare = line.rstrip()
        if bare.endswith(b"\\") and b"#" not in bare:
            open_lines.append(bare[:-1])
            continue
        if open_lines:
            done.append(b" ".join([*open_lines, line]) + b"\n" * len(open_lines))
            open_lines = []
        else:
            done.append(line)
    return b"\n".join([*done, b" ".join(open_lines)])


def with_decimal_points(data: bytes) -> tuple[bytes, int]:
    """The text with the decimal commas of its vertices as points, and how many vertices have them."""
    first = _VERTEX_COMMA.search(data) if b"," in data else None
    if first is None:
        return data, 0
    rows = [match[0].split(b"#")[0] for match in _VERTEX_LINE.finditer(data)]
    if not all(is_decimal_comma(row.split()[1:]) for row in rows):
        raise ambiguous_comma(Format.OBJ, data.count(b"\n", 0, first.start()) + 1)
    text = _VERTEX_LINE.sub(lambda match: match[0].replace(b",", b"."), data)
    return text, sum(b"," in row for row in rows)


def without_comments(block: bytes) -> bytes:
    """The text with spaces for comments behind vertices and elements. (Names may contain a `#`.)"""
    if b"#" not in block:
        return block
    blank = bytearray(block)
    end = 0
    while (start := block.find(b"#", end)) >= 0:
        end = (block.find(b"\n", start) + 1 or len(block) + 1) - 1
        head = block[block.rfind(b"\n", 0, start) + 1 : start].split(maxsplit=1)
        if head and head[0] in _WITH_INDICES:
            blank[start:end] = b" " * (end - start)
    return bytes(blank)
