"""Results on a terminal: the verdict, the transform and the RMSEs; or the segments."""

from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

RMSES = {
    "rmse_initial_mm": "as uploaded",
    "rmse_landmarks_mm": "by landmarks alone",
    "rmse_complete_mm": "by ICP without landmarks",
    "rmse_mm": "final",
}


def print_results(results: dict[str, Any], out: Path | None, console: Console) -> None:
    """A summary of results.json for a person."""
    verdict = results["verdict"]
    confidence = "" if verdict["confidence"] is None else f" (confidence {verdict['confidence']:.2f})"
    console.print(f"verdict: [bold]{verdict['status']}[/bold]{confidence}", highlight=False)
    for finding in verdict["findings"]:
        console.print(f"  {finding['code']}: {finding['detail']}", highlight=False, markup=False)
    if results["transform"] is not None:
        console.print(results["transform"]["convention"], highlight=False, markup=False)
        for row in results["transform"]["matrix"]:
            console.print("  " + " ".join(f"{value:12.6f}" for value in row), highlight=False)
    table = Table("RMSE", "mm", box=None, pad_edge=False)
    for key, words in RMSES.items():
        value = results["metrics"][key]
        table.add_row(words, "-" if value is None else f"{value:.4f}")
    console.print(table)
    _print_end(results, out, console)


def print_segments(results: dict[str, Any], out: Path | None, console: Console) -> None:
    """A summary of the results.json of `find_segments` for a person."""
    segments = results["segments"]["mesh"]
    console.print(f"segments: [bold]{segments['count']}[/bold] by {segments['method']}", highlight=False)
    console.print(f"d_c: {segments['d_c']:.4g} mm", highlight=False)
    console.print(f"halo: {segments['halo_fraction']:.1%} of the working vertices", highlight=False)
    _print_end(results, out, console)


def _print_end(results: dict[str, Any], out: Path | None, console: Console) -> None:
    """Warnings, and where the files are."""
    for warning in results["warnings"]:
        console.print(f"warning: {warning['code']}: {warning['detail']}", highlight=False, markup=False)
    if out is not None:
        console.print(f"files: {out}", highlight=False, markup=False)
