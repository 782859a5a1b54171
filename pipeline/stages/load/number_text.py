"""Numbers in a text, with the line of each."""

import re
import warnings
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import UnreadableFile
from pipeline.core.mesh import FloatArray, IndexArray

#: Bytes of text that are read at a time.
BLOCK_BYTES = 1 << 22
#: How Microsoft's C library writes what is not finite: 1.#QNAN, -1.#IND, 1.#INF.
_MICROSOFT = re.compile(rb"[-+]?1\.#[A-Z]+0*")
_IS_SPACE = np.isin(np.arange(256), list(b" \t\n\v\f\r"))


@dataclass(frozen=True, slots=True, eq=False)
class NumberText:
    """values : (n,) the numbers, to the first word that is none; first : (l + 1,) the number that each line
    with words starts with, and the end; lines : (l,) of the file, the first is 1; stopped : the word that is
    no number
    """

    values: FloatArray
    first: IndexArray
    lines: IndexArray
    stopped: bytes | None

    @property
    def n_lines(self) -> int:
        """Lines with words."""
        return len(self.lines)

    @property
    def shown(self) -> str:
        """The word that is no number, for errors."""
        return repr((self.stopped or b"").decode("utf-8", errors="replace")[:40])

    def line_of(self, number: int) -> int:
        """Line of the file that has a number, by its position."""
        return int(self.lines[np.searchsorted(self.first[1:], number, side="right")])


def read_numbers(text: bytes, first_line: int) -> NumberText:
    """The numbers of `text`, whose first line is `first_line` of its file; lines end by LF, else by CR.

    Memory is at most eight times the text. NaN and infinity in the words of C and of Microsoft.
    """
    if b"#" in text:
        text = _MICROSOFT.sub(b"nan", text)
    if b"(" in text:
        text = text.replace(b"nan(ind)", b"nan").replace(b"nan(snan)", b"nan")
    ender = b"\n" if b"\n" in text else b"\r"
    values, firsts, lines = [np.zeros(0)], [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    at, count, line = 0, 0, first_line
    stopped: bytes | None = None
    while at < len(text) and stopped is None:
        end = text.find(ender, at + BLOCK_BYTES)
        block = text[at:] if end < 0 else text[at : end + 1]
        words, of_line, n_ends = _structure(block, ender)
        numbers, stopped = parsed(block, words)
        values.append(numbers)
        firsts.append(count + of_line[0])
        lines.append(line + of_line[1])
        at, count, line = at + len(block), count + words, line + n_ends
    firsts.append(np.array([count]))
    return NumberText(np.concatenate(values), np.concatenate(firsts), np.concatenate(lines), stopped)


def parsed(text: bytes, words: int) -> tuple[FloatArray, bytes | None]:
    """The numbers of a text of that many words, to the first word that is none, and this word."""
    if words == 0:
        return np.zeros(0), None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", DeprecationWarning)  # numpy below 2.3 warns of a word that is none
            numbers = np.fromstring(text, sep=" ")
    except (ValueError, DeprecationWarning):
        numbers = np.zeros(0)
    if len(numbers) == words:
        return numbers, None
    good: list[float] = []
    for word in text.split():
        try:
            good.append(float(word.replace(b"_", b"?")))
        except ValueError:
            return np.array(good), word
    return np.array(good), None


def _structure(block: bytes, ender: bytes) -> tuple[int, tuple[IndexArray, IndexArray], int]:
    """Words of a block; of each line with words, its first word and its number in the block; line ends."""
    raw = np.frombuffer(block, dtype=np.uint8)
    space = _IS_SPACE[raw]
    begins = ~space
    begins[1:] &= space[:-1]
    words = np.flatnonzero(begins)
    ends = np.flatnonzero(raw == ender[0])
    before = np.concatenate([[0], np.searchsorted(words, ends), [len(words)]])
    used = np.flatnonzero(np.diff(before))
    return len(words), (before[used], used), len(ends)


def without_commas(text: bytes, numbers: bytes, kind: str, line: int) -> tuple[bytes, bool]:
    """`text` with 1.5 for each 1,5, and whether it has such commas; a comma before a space separates.

    numbers : the parts of the text that are numbers; line : that of the first comma

    Raises
    ------
    UnreadableFile
        Where decimal points occur too, so that 1,500 is not clear.
    """
    text = re.sub(rb",(?=\s)", b" ", text)
    if re.search(rb"\d,\d", numbers) is None:
        return text, False
    if b"." in numbers:
        raise UnreadableFile(
            f"line {line} of the {kind} has a comma in a number, and other numbers have points",
            remedy="export the file with decimal points only, without separators of thousands",
        )
    return re.sub(rb"(?<=\d),(?=\d)", b".", text), True
