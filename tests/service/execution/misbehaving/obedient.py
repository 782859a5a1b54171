"""Does at once what a job should: writes results and one file."""

from pathlib import Path


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    on_progress("load", 1.0, "reading")
    out = Path(task["out"])
    out.mkdir(exist_ok=True)
    (out / "results.json").write_text('{"schema_version": "1", "verdict": {"status": "ok"}}')
    (out / "aligned.ply").write_bytes(b"ply\n")
    on_progress("report", 99.0, "writing")
