"""Leaves an answer that no job of ours would."""

import json
import os
from pathlib import Path

PROBLEM = {
    "type": "urn:cusp:problem:no_surface",
    "title": "The mesh has no triangles",
    "status": 422,
    "code": "no_surface",
    "detail": "words",
}


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    answer = Path("answer.json")
    match task["answer"]:
        case "link":
            (Path("..") / "elsewhere.json").write_text('{"problem": null}')
            answer.symlink_to("../elsewhere.json")
        case "pipe":
            os.mkfifo(answer)
        case "large":
            answer.write_text('{"problem": null}' + " " * (1 << 20))
        case "deep":
            answer.write_text("[" * 60_000)
        case "other status":
            answer.write_text(json.dumps({"problem": {**PROBLEM, "status": 200}}))
        case "more fields":
            answer.write_text(json.dumps({"problem": {**PROBLEM, "instance": "x"}}))
        case "good":
            answer.write_text(json.dumps({"problem": PROBLEM}))
    os._exit(0)
