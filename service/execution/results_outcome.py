"""What of results.json jobs are listed by: two words and a share."""

import json
import math
from pathlib import Path
from typing import TypedDict

RESULTS_FILE = "results.json"
#: Of results.json, a file of the job's process that the worker reads whole; the largest of ours have 1 MiB.
MAX_RESULTS_BYTES = 16 * 1024 * 1024


class ResultsOutcome(TypedDict):
    """Of a registration; None for other types of job."""

    verdict: str | None
    decision: str | None
    within: float | None


def outcome_of(results: Path) -> ResultsOutcome:
    """Read from results.json: a file of the job's process, so anything in it is checked."""
    try:
        document = json.loads(results.read_bytes())
    except (OSError, ValueError, RecursionError):
        document = None
    return {
        "verdict": _word(document, "verdict", "status", 32),
        "decision": _word(document, "inspection", "decision", 16),
        "within": _share(document, "deviation", "within"),
    }


def _word(document: object, block: str, name: str, max_length: int) -> str | None:
    part = document.get(block) if isinstance(document, dict) else None
    word = part.get(name) if isinstance(part, dict) else None
    return word if isinstance(word, str) and word.isidentifier() and len(word) <= max_length else None


def _share(document: object, block: str, name: str) -> float | None:
    part = document.get(block) if isinstance(document, dict) else None
    value = part.get(name) if isinstance(part, dict) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) and 0 <= value <= 1 else None
