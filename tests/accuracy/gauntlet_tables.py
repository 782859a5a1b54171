"""The rows of the gauntlet, one a case and tool, and the tables that are printed of them."""

import json
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from tests.accuracy import gauntlet_specs, peers

CUSP = "cusp"
SMALL_ERROR = 2e-4  # of the diagonal: what the choice of 10,000 points alone makes of a scan
WIDTH = 185


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


def table(path: Path, console: Console | None = None) -> None:
    """The tables of a file of rows."""
    print_tables(list(read_rows(path).values()), console or Console(width=WIDTH))


def print_tables(rows: list[Row], console: Console) -> None:
    ours = [row for row in rows if row.tool == CUSP]
    there = {row.group for row in ours}
    groups = [group for group in gauntlet_specs.groups() if group in there]
    console.print(_quality(ours, groups))
    others = [name for name in peers.PEERS if any(row.tool == name for row in rows)]
    if others:
        console.print(_success(rows, [CUSP, *others], groups))
    memory = [row for row in rows if row.tool == "memory"]
    for row in memory:
        console.print(f"peak memory, {row.case}: {row.peak_mb:.0f} MB")
    for words, chosen in (
        ("wrong but ok", [row for row in ours if row.wrong_but_ok]),
        ("another verdict than expected", [row for row in ours if row.unexpected and not row.wrong_but_ok]),
        (
            "wrong pose",
            [row for row in ours if row.right is False and not row.unexpected and not row.wrong_but_ok],
        ),
    ):
        console.print(f"\n{words}: {len(chosen)}")
        for row in chosen:
            console.print(_line(row), soft_wrap=True, highlight=False)
    total = Counter(row.wrong_but_ok for row in ours)
    console.print(f"\n{total.total()} cases, {total[True]} wrong but ok")


def _quality(ours: list[Row], groups: list[str]) -> Table:
    made = Table(
        *(
            "group",
            "cases",
            "right pose",
            "expected verdict",
            "wrong but ok",
            "right called ok",
            "rotation, deg",
        ),
        *("translation, %", "over ICP from truth", "seconds", "of CPU"),
        title="Cusp; median, 95 % of the errors of right poses and of the seconds",
    )
    for group in [*groups, "all"]:
        rows = [row for row in ours if group in (row.group, "all")]
        posed = [row for row in rows if row.right is not None]
        right = [row for row in posed if row.right]
        may_be_ok = [row for row in right if "ok" in row.expected]
        made.add_row(
            *(group, str(len(rows)), _share(len(right), len(posed))),
            _share(sum(not row.unexpected for row in rows), len(rows)),
            str(sum(row.wrong_but_ok for row in rows)),
            _share(sum(row.status == "ok" for row in may_be_ok), len(may_be_ok)),
            _spread([row.rotation_deg for row in right if row.rotation_deg is not None]),
            _spread([100 * row.translation_share for row in right if row.translation_share is not None]),
            _spread([ratio for row in right if (ratio := row.over_truth) is not None]),
            *(_spread([row.seconds for row in rows], 1), _spread([row.cpu_s for row in rows], 1)),
            end_section=group == groups[-1],
        )
    return made


def _success(rows: list[Row], tools: list[str], groups: list[str]) -> Table:
    """Over the cases that every tool has run, so that the columns compare. A case for which all poses are
    wrong by their very data (`Case.drift`) counts against all. "+n refused": the right pose was found, and
    the verdict gave none; peers have no verdict.
    """
    of = {
        tool: {row.case: row for row in rows if row.tool == tool and row.right is not None} for tool in tools
    }
    common = set.intersection(*(set(cases) for cases in of.values()))
    made = Table("group", "cases", *tools, title="Right pose, same cases; every peer refined by the same ICP")
    for group in [*groups, "all"]:
        cases = [case for case in common if group in (of[CUSP][case].group, "all")]
        if cases:
            shares = [_share(sum(bool(of[tool][case].right) for case in cases), len(cases)) for tool in tools]
            refused = sum(of[CUSP][case].right_but_refused for case in cases)
            shares[0] += f" (+{refused} refused)" if refused else ""
            made.add_row(group, str(len(cases)), *shares)
    if common:
        for words, what in (("median s", "seconds"), ("median s of CPU", "cpu_s")):
            made.add_row(
                words,
                "",
                *(f"{np.median([getattr(of[t][case], what) for case in common]):.1f}" for t in tools),
            )
    return made


def _line(row: Row) -> str:
    words = f"  {row.case}: {row.status}, expected {' or '.join(row.expected)}"
    if row.error_share is not None:
        words += f"; {100 * row.error_share:.2f} % off"
        words += f" ({100 * row.rms_share:.2f} % rms, {100 * row.rms_true_share:.2f} % under the true pose)"
    if not row.flagged:
        words += "; no alternative is flagged symmetry_of_design"
    if row.confidence is not None:
        words += f"; confidence {row.confidence:.2f}"
    return words + f"; {', '.join(row.findings)}" * bool(row.findings) + f"; {row.detail}" * bool(row.detail)


def _share(count: int, of: int) -> str:
    return f"{count / of:.1%}" if of else "-"


def _spread(values: list[float], digits: int = 2) -> str:
    return f"{np.median(values):.{digits}f}, {np.quantile(values, 0.95):.{digits}f}" if values else "-"
