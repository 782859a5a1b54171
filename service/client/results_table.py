"""Results on a terminal, in a few lines: what each type of results says first."""

from collections import Counter
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

DECISIONS = {"pass": "pass", "fail": "fail", "not_judged": "not judged"}
PASSED = {True: "passed", False: "failed", None: "not judged"}
RMSES = {
    "rmse_initial_mm": "as uploaded",
    "rmse_landmarks_mm": "by landmarks alone",
    "rmse_complete_mm": "by ICP without landmarks",
    "rmse_mm": "final",
}


def print_results(results: dict[str, Any], out: Path | None, console: Console) -> None:
    """A summary of results.json for a person; warnings and where the files are come last."""
    {
        "registration": _registration,
        "segments": _segments,
        "landmarks": _landmarks,
        "study": _study,
    }[results["type"]](results, console)
    for warning in results["warnings"]:
        console.print(f"warning: {warning['code']}: {warning['detail']}", highlight=False, markup=False)
    if out is not None:
        console.print(f"files: {out}", highlight=False, markup=False)


def _registration(results: dict[str, Any], console: Console) -> None:
    """Verdict on the alignment, transform, RMSEs."""
    verdict = results["verdict"]
    console.print(f"alignment: [bold]{verdict['status']}[/bold] ({_confidence(verdict)})", highlight=False)
    for finding in verdict["findings"]:
        console.print(f"  {finding['code']}: {finding['detail']}", highlight=False, markup=False)
    _inspection(results.get("inspection"), console)
    if results["transform"] is not None:
        console.print(results["transform"]["convention"], highlight=False, markup=False)
        for row in results["transform"]["matrix"]:
            console.print("  " + " ".join(f"{value:12.6f}" for value in row), highlight=False)
    table = Table("RMSE", "mm", box=None, pad_edge=False)
    for key, words in RMSES.items():
        value = results["metrics"][key]
        table.add_row(words, "-" if value is None else f"{value:.4f}")
    console.print(table)


def _inspection(inspection: dict[str, Any] | None, console: Console) -> None:
    """The decision on the part, and every check; earlier results have none."""
    if inspection is None:
        return
    console.print(f"part: [bold]{DECISIONS[inspection['decision']]}[/bold]", highlight=False)
    if not inspection["checks"]:
        return
    for reason in inspection["reasons"]:
        console.print(f"  {reason}", highlight=False, markup=False)
    table = Table("check", "value", "limits", "", box=None, pad_edge=False)
    for check in inspection["checks"]:
        value = _measure(check["value"], check["unit"])
        table.add_row(check["name"], value, _limits(check), PASSED[check["passed"]])
    console.print(table)


def _limits(check: dict[str, Any]) -> str:
    lower, upper = (_measure(check[end], check["unit"]) for end in ("lower", "upper"))
    if check["lower"] is None or check["upper"] is None:
        return f"at most {upper}" if check["lower"] is None else f"at least {lower}"
    return f"{lower} to {upper}"


def _measure(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    return f"{100 * value:.1f} %" if unit == "1" else f"{value:+.3f} mm"


def _confidence(verdict: dict[str, Any]) -> str:
    """`confidence 0.97 (same part 0.98, pose 0.99)`; earlier results do not have the two probabilities."""
    if verdict["confidence"] is None:
        return "confidence not given"
    parts = [(words, verdict.get(key)) for words, key in (("same part", "same_part"), ("pose", "pose"))]
    probabilities = ", ".join(f"{words} {value:.2f}" for words, value in parts if value is not None)
    return f"confidence {verdict['confidence']:.2f}" + (f": {probabilities}" if probabilities else "")


def _segments(results: dict[str, Any], console: Console) -> None:
    segments = results["segments"]["mesh"]
    console.print(f"segments: [bold]{segments['count']}[/bold] by {segments['method']}", highlight=False)
    console.print(f"d_c: {segments['d_c']:.4g} mm", highlight=False)
    console.print(f"halo: {segments['halo_fraction']:.1%} of the working vertices", highlight=False)


def _landmarks(results: dict[str, Any], console: Console) -> None:
    """How many, and how many in each segment."""
    marks, segments = results["landmarks"]["mesh"], results["segments"]["mesh"]
    detector = results["provenance"]["settings"]["landmarks"]["detector"]
    console.print(
        f"landmarks: [bold]{len(marks)}[/bold] by {detector}, in {segments['count']} segments",
        highlight=False,
    )
    table = Table("segment", "vertices", "landmarks", box=None, pad_edge=False)
    marked = Counter(mark["segment"] for mark in marks)
    for centre in segments["centres"]:
        table.add_row(str(centre["segment"]), str(centre["size"]), str(marked[centre["segment"]]))
    console.print(table)


def _study(results: dict[str, Any], console: Console) -> None:
    """A row a detector (and ICP protocol or condition), and what it comes to in words."""
    protocol = results["protocol"]
    console.print(f"study: [bold]{protocol['kind']}[/bold], {protocol['trials']} trials", highlight=False)
    if results["informativeness"] is not None:
        table = Table("detector", "ICP", "points", "K > 1", "ties", "median K", box=None, pad_edge=False)
        for row in results["informativeness"]:
            shares = (f"{row['share_above']:.1%}", f"{row['share_tie']:.1%}")
            table.add_row(row["detector"], row["icp"], str(row["points"]), *shares, _number(row["k"]["p50"]))
        console.print(table)
    if results["repeatability"] is not None:
        table = Table(
            "detector", "condition", "found again", "by chance", "points", "pose", box=None, pad_edge=False
        )
        for row in results["repeatability"]:
            shares = (f"{row['mean']:.1%}", f"{row['chance']:.1%}")
            table.add_row(
                row["detector"], row["condition"], *shares, f"{row['points']:.1f}", f"{row['pose_right']:.0%}"
            )
        console.print(table)
    console.print(results["summary"], highlight=False, markup=False)


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
