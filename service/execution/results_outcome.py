"""What of results.json jobs are listed by: two words and a share."""

import json
from pathlib import Path
from typing import TypedDict

from service.execution.job_answer import read_regular_file

RESULTS_FILE = "results.json"
#: Of results.json, a file of the job's process that the worker reads whole: nothing but brackets, it would
#: take 100 MiB of memory. Ours have some 0.1 MiB.
MAX_RESULTS_BYTES = 4 * 1024 * 1024


class ResultsOutcome(TypedDict):
    """Of a registration; None for other types of job."""

    verdict: str | None
    decision: str | None
    within: float | None


def outcome_of(results: Path) -> ResultsOutcome:
    """Read from results.json: a file of the job's process, so anything in it is checked."""
    content = read_regular_file(results, MAX_RESULTS_BYTES + 1)
    try:
        document = None if content is None or len(content) > MAX_RESULTS_BYTES else json.loads(content)
    except (ValueError, RecursionError):
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
    return float(value) if 0 <= value <= 1 else None  # a NaN is not
