"""The rows of the gauntlet, one a case and tool, and the file of JSON lines that keeps them."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path

CUSP = "cusp"
SMALL_ERROR = 2e-4  # of the diagonal: what the choice of 10,000 points alone makes of a scan


@dataclass(frozen=True, slots=True)
class Row:
    """What one tool made of one case. right : None where no pose is; at_rival : right, but only as one of
    `Case.rivals`, which the scan cannot tell from the truth, so it must not be called `ok`; *_share : of the
    diagonal; rms_true_share : how far the scan lies off the design under the nearest truth, to tell a wrong
    pose that fits better from one that does not;
    from_truth_share : error of ICP that starts at the truth
    """

    case: str
    group: str
    tool: str
    status: str
    expected: tuple[str, ...]
    right: bool | None
    seconds: float
    cpu_s: float
    error_share: float | None = None
    rotation_deg: float | None = None
    translation_share: float | None = None
    rms_share: float | None = None
    rms_true_share: float | None = None
    from_truth_share: float | None = None
    confidence: float | None = None
    findings: tuple[str, ...] = ()
    at_rival: bool = False
    flagged: bool = True
    right_but_refused: bool = False
    drift: float | None = None
    peak_mb: float | None = None
    detail: str = ""

    @property
    def wrong_but_ok(self) -> bool:
        return self.status == "ok" and (not self.right or self.at_rival)

    @property
    def refused_a_right_pose(self) -> bool:
        """Whether the best pose is right, and `no_match` or `mirrored` gave none."""
        return self.right_but_refused and self.status in {"no_match", "mirrored"}

    @property
    def over_truth(self) -> float | None:
        """Error over that of ICP started at the truth; errors below `SMALL_ERROR` are as good as none."""
        if self.error_share is None or self.from_truth_share is None:
            return None
        return max(self.error_share, SMALL_ERROR) / max(self.from_truth_share, SMALL_ERROR)

    @property
    def unexpected(self) -> bool:
        return self.tool == CUSP and (self.status not in self.expected or not self.flagged)


def read_rows(path: Path) -> dict[tuple[str, str], Row]:
    """The last line of each case and tool; half a line, of an interrupted run, is left out."""
    last: dict[tuple[str, str], Row] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            words = json.loads(line)
        except json.JSONDecodeError:
            continue
        row = Row(**(words | {name: tuple(words[name]) for name in ("expected", "findings")}))
        last[row.case, row.tool] = row
    return last


@dataclass(slots=True)
class Log:
    """The lines of `--out`: what is in it, and what is added."""

    path: Path | None
    rows: dict[tuple[str, str], Row] = field(default_factory=dict)  # by case and tool

    def __post_init__(self) -> None:
        if self.path is not None and self.path.exists():
            self.rows = read_rows(self.path)

    def done(self) -> set[tuple[str, str]]:
        return {key for key, row in self.rows.items() if row.status not in {"not built", "crashed"}}

    def add(self, rows: Iterable[Row]) -> None:
        for row in rows:
            self.rows[row.case, row.tool] = row
            if self.path is not None:
                with self.path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(row)) + "\n")
