"""The words of an ASCII STL, one after the other, with the line of each for errors."""

import re

import numpy as np

from pipeline.core.errors import TruncatedFile, UnreadableFile
from pipeline.core.mesh import FloatArray

_WORD = re.compile(rb"\S+")
_LINE = re.compile(rb"[^\r\n]*")
#: The first facet, where it stands in the line of `solid`: a file of one line.
_FACET = re.compile(rb"facet\s+normal(?:\s+\S+){3}\s+outer\s+loop\s", re.IGNORECASE)
_VERTEX = re.compile(rb"\bvertex\b[^\r\na-df-z]*", re.IGNORECASE)
#: Words that are written as two by some.
_JOINED = {"end": ("solid", "facet", "loop"), "outer": ("loop",)}


class CommaInNumber(Exception):  # caught by the reader
    """A number has a comma. line : of the file"""

    def __init__(self, line: int) -> None:
        super().__init__(line)
        self.line = line


class Words:
    """at : byte of the next word"""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0
        self._begin = 0
        self._line_end = -1

    @property
    def line(self) -> int:
        """Line of the last word, the first is 1; LF, CRLF and CR end lines."""
        before = self.data[: self._begin]
        return 1 + before.count(b"\n") + before.count(b"\r") - before.count(b"\r\n")

    def keyword(self) -> str:
        """The next word in lower case, `end facet` as `endfacet`; empty at the end of the file."""
        begin_word = self._next()
        word = begin_word.lower()
        if word.startswith("endsolid"):  # Assimp 5.0 writes the name without a space (issue 3756)
            self.at = self._begin + len("endsolid")
            return "endsolid"
        if word in _JOINED:
            begin = self._begin
            second = self._next().lower()
            self._begin = begin
            return word + second
        return word

    def name(self) -> str:
        """What is left of the line; not the first facet, if it is in the same line."""
        if self.at > self._line_end:  # found once a line: a file may be one line of many solids
            found = _LINE.match(self.data, self.at)
            self._line_end = found.end() if found else self.at
        facet = _FACET.search(self.data, self.at, self._line_end)
        end = facet.start() if facet else self._line_end
        name = self.data[self.at : end].decode("utf-8", errors="replace").strip()
        self.at = end
        return name

    def facet(self) -> FloatArray:
        """(k, 3) corners of a facet, whose first word was read."""
        word = self.keyword()
        while word != "outerloop":  # the normal is not used
            if word in ("", "vertex", "facet", "endloop", "endfacet", "solid", "endsolid"):
                raise self.unexpected("outer loop")
            word = self.keyword()
        corners: list[list[float]] = []
        while (word := self.keyword()) == "vertex":
            corners.append([self._number(), self._number(), self._number()])
        if word != "endloop":
            raise self.unexpected("vertex or endloop")
        if len(corners) < 3:
            raise UnreadableFile(
                f"line {self.line} of the STL ends a facet with {len(corners)} vertices, not 3"
            )
        if self.keyword() != "endfacet":
            raise self.unexpected("endfacet")
        return np.array(corners)

    def unexpected(self, expected: str) -> TruncatedFile | UnreadableFile:
        """The last word is another than `expected`, or the file has ended."""
        if _WORD.search(self.data, self.at) is None:
            return TruncatedFile(f"the ASCII STL ends inside a facet, in line {self.line}, before {expected}")
        return UnreadableFile(f"line {self.line} of the STL has {self._shown()} where {expected} is expected")

    def _next(self) -> str:
        found = _WORD.search(self.data, self.at)
        self._begin, self.at = found.span() if found else (len(self.data), len(self.data))
        return self.data[self._begin : self.at].decode("utf-8", errors="replace")

    def _number(self) -> float:
        word = self._next()
        try:
            return float(word.replace("_", "?"))
        except ValueError:
            pass
        if re.fullmatch(r"[-+\d.,eE]+", word) and "," in word:
            raise CommaInNumber(self.line)
        if _WORD.search(self.data, self.at) is None:
            raise self.unexpected("a coordinate")
        raise UnreadableFile(
            f"line {self.line} of the STL has {self._shown()} where a coordinate is expected: "
            "a vertex has three numbers"
        )

    def _shown(self) -> str:
        return repr(self.data[self._begin : self.at][:40].decode("utf-8", errors="replace"))


def numbers_of(data: bytes) -> bytes:
    """The coordinates of the vertices of an ASCII STL."""
    return b"\n".join(each.group() for each in _VERTEX.finditer(data))
