"""The tables that are printed of the rows of the gauntlet."""

import itertools
from collections import Counter
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from pipeline.core.mesh import FloatArray
from tests.accuracy import gauntlet_specs, peers
from tests.accuracy.gauntlet_rows import CUSP, Row, read_rows

WIDTH = 185
WITH_POSE = ("ok", "uncertain", "ambiguous", "under_constrained", "units_suspect")
BINS = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)


def table(path: Path, console: Console | None = None) -> None:
    """The tables of a file of rows."""
    print_tables(list(read_rows(path).values()), console or Console(width=WIDTH))


def print_tables(rows: list[Row], console: Console) -> None:
    ours = [row for row in rows if row.tool == CUSP]
    there = {row.group for row in ours}
    groups = [group for group in gauntlet_specs.groups() if group in there]
    console.print(_quality(ours, groups))
    console.print(_verdicts(ours, groups))
    said = [
        row
        for row in ours
        if row.confidence is not None and row.status in WITH_POSE and row.right is not None
    ]
    if said:
        confidences = np.array([row.confidence for row in said], dtype=np.float64)
        right = np.array([bool(row.right) and not row.at_rival for row in said], dtype=np.float64)
        console.print(reliability(confidences, right, "confidence of the poses given"))
    others = [name for name in peers.PEERS if any(row.tool == name for row in rows)]
    if others:
        console.print(_success(rows, [CUSP, *others], groups))
    memory = [row for row in rows if row.tool == "memory"]
    for row in memory:
        console.print(f"peak memory, {row.case}: {row.peak_mb:.0f} MB")
    for words, chosen in (
        ("wrong but ok", [row for row in ours if row.wrong_but_ok]),
        ("another verdict than expected", [row for row in ours if row.unexpected and not row.wrong_but_ok]),
        ("right but refused", [row for row in ours if row.refused_a_right_pose]),
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


def _verdicts(ours: list[Row], groups: list[str]) -> Table:
    """Of the cases with a right pose that the search found: what the verdict made of it."""
    made = Table(
        *("group", "right pose found", "ok", "ok or uncertain", "other, with a pose", "refused"),
        "wrong but ok",
        title="Verdicts on right poses; refused: no_match or mirrored",
    )
    for group in [*groups, "all"]:
        rows = [row for row in ours if group in (row.group, "all")]
        found = [row for row in rows if row.right or row.right_but_refused]
        ok, unsure = (sum(row.status == status for row in found) for status in ("ok", "uncertain"))
        refused = sum(row.refused_a_right_pose for row in found)
        made.add_row(
            *(group, str(len(found)), _share(ok, len(found)), _share(ok + unsure, len(found))),
            *(_share(len(found) - ok - unsure - refused, len(found)), _share(refused, len(found))),
            str(sum(row.wrong_but_ok for row in rows)),
            end_section=group == groups[-1],
        )
    return made


def reliability(said: FloatArray, right: FloatArray, title: str) -> Table:
    """Of the poses that say so much, how many are right. Brier score in the title."""
    brier = float(np.mean((said - right) ** 2))
    made = Table(
        "confidence",
        "cases",
        "mean said",
        "right",
        title=f"{title}: {len(said)} cases, Brier score {brier:.4f}",
    )
    for low, high in itertools.pairwise(BINS):
        chosen = (said >= low) & ((said < high) | (high == 1.0))
        if chosen.any():
            made.add_row(
                f"{low} to {high}",
                str(chosen.sum()),
                f"{said[chosen].mean():.3f}",
                f"{right[chosen].mean():.3f}",
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
