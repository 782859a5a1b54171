"""The lines of a point text: decoded, without comments and blank lines, with their numbers for errors."""

import re
from dataclasses import dataclass

from pipeline.core.errors import TruncatedFile, UnreadableFile
from pipeline.core.formats import MINUS, as_utf8

REMEDY = "state the columns in options.columns, such as id,x,y,z; or write a heading x y z"
#: Longest line; a longer one is no point, and takes memory.
MAX_LINE_BYTES = 1 << 16
TOO_LONG = f"has more than {MAX_LINE_BYTES} bytes, which is no point"
#: Stands for a comma within quotes, once the quotes are gone: it separates no columns.
QUOTED_COMMA = b"\x01"
#: How Microsoft's C library writes what is not finite: 1.#QNAN, -1.#IND, 1.#INF.
_MICROSOFT = re.compile(rb"[-+]?1\.#[A-Z]+0*")
_NAN_OF_C = re.compile(rb"nan\([a-z]+\)", re.IGNORECASE)
#: Lines without a point. A line that starts with a semicolon and has another one is a row whose first column
#: is empty.
_NO_ROW = re.compile(rb"^[ \t\f\v]*(?:(?:#|//|%|!)[^\n]*|;[^;\n]*)?\n", re.MULTILINE)
#: Starts of lines that `_NO_ROW` may match.
_MAY_BE_NO_ROW = (b"#", b"//", b"%", b"!", b";", b" ", b"\t", b"\f", b"\v", b"\n")
_COMMENT_AFTER_ROW = re.compile(rb"[ \t](?:#|//)[^\n]*")
_QUOTED = re.compile(rb'"([^"\n]*)"')
_WITHIN_QUOTES = bytes.maketrans(b",; \t|", QUOTED_COMMA + b"____")


class BadRow(Exception):
    """A row that cannot be read. row : its position among the rows; reason : what is wrong with it, in the
    sentence "line 7 has ..."; fewer : it has less columns than the others; remedy :
    other than to write points as x y z
    """

    def __init__(self, row: int, reason: str, *, fewer: bool = False, remedy: str | None = None) -> None:
        super().__init__(reason)
        self.row = row
        self.reason = reason
        self.fewer = fewer
        self.remedy = remedy


@dataclass(frozen=True, slots=True)
class Rows:
    """text : the rows, each ended by LF, without comments, blank lines and quotes; source : the part of the
    file that they are from; first_line : its line number; cut : the file does not end with a line end
    """

    text: bytes
    source: bytes
    first_line: int
    cut: bool

    def place(self, row: int) -> tuple[int, str]:
        """Line number of a row, and what stands in it, shortened."""
        at = 0
        for number, line in enumerate(self.source.split(b"\n"), self.first_line):
            if _NO_ROW.fullmatch(line + b"\n"):
                continue
            if at == row:
                return number, shown(line)
            at += 1
        return self.first_line, ""

    def refused(self, bad: BadRow) -> UnreadableFile | TruncatedFile:
        """The error for a row, with its line."""
        number, line = self.place(bad.row)
        if bad.fewer and self.cut and bad.row == self.text.count(b"\n") - 1:
            return TruncatedFile(f"the file ends within line {number}, which {bad.reason}: {line}")
        return UnreadableFile(
            f"line {number} {bad.reason}: {line}",
            remedy=bad.remedy or "write one point on each line: x y z, with the same columns on all lines",
        )

    def unclear(self, row: int, first: str, second: str, remedy: str | None = None) -> UnreadableFile:
        """The error for a text that has two meanings, at a row that shows both."""
        number, line = self.place(row)
        return UnreadableFile(
            f"line {number} can be read in two ways, {first} or {second}: {line}", remedy=remedy or REMEDY
        )


def shown(line: bytes) -> str:
    """A line for errors, shortened."""
    text = line.decode("utf-8", errors="replace").strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")


def decoded(data: bytes) -> bytes:
    """The text with LF line ends, without byte order mark; bytes beyond ASCII as they are.

    Raises
    ------
    UnreadableFile
        When it has zero bytes.
    """
    text = as_utf8(data).rstrip(b"\x1a")  # Ctrl-Z, the end of a text in DOS
    if b"\0" in text:
        raise UnreadableFile("the text has bytes of value zero", remedy="save the text as UTF-8")
    if b"\r" in text:
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    if MINUS in text:
        text = text.replace(MINUS, b"-")
    return text


def rows_of(source: bytes, first_line: int) -> Rows:
    """The rows of a part of a text; linear in its length."""
    cut = not source.endswith(b"\n")
    text = source + b"\n" if cut else source
    if b"#" in text:
        text = _MICROSOFT.sub(b"nan", text)
    if b"(" in text:
        text = _NAN_OF_C.sub(b"nan", text)
    if text.startswith(_MAY_BE_NO_ROW) or any(b"\n" + mark in text for mark in _MAY_BE_NO_ROW):
        text = _NO_ROW.sub(b"", text)
    if b"#" in text or b"//" in text:
        text = _COMMENT_AFTER_ROW.sub(b"", text)
    if b'"' in text:
        text = _QUOTED.sub(lambda found: found[1].translate(_WITHIN_QUOTES), text)
    if b"\f" in text or b"\v" in text:
        text = text.replace(b"\f", b" ").replace(b"\v", b" ")
    return Rows(text, source, first_line, cut)
