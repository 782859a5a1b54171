"""What the process of a job says about its end: one small file in its folder.

The process may be in the hands of an attacker, so the file says only *what* it found, never *that* it ended:
the worker reads it after the kernel reported the end, with a limit on its size, and checks it by schema.
"""

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import pydantic
from pydantic import BaseModel, ConfigDict, Field

from service.contract.errors import PROBLEM_CODES
from service.contract.schemas import Problem
from service.storage.regular_file import open_regular_file

ANSWER_FILE = "answer.json"
MAX_ANSWER_BYTES = 64 * 1024
MAX_DETAIL = 8000  # characters; the longest of ours are some hundred


class _Problem(BaseModel):
    """A problem of this program; `Problem` itself allows members that later versions add."""

    model_config = ConfigDict(extra="forbid", strict=True)

    type: str = Field(max_length=200)
    title: str = Field(max_length=200)
    status: int = Field(ge=400, le=599)
    detail: str = Field(max_length=MAX_DETAIL)
    code: str = Field(max_length=100)
    mesh: Literal["design", "scan", "mesh"] | None = None
    stage: str | None = Field(None, max_length=32)


class _Answer(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)

    problem: _Problem | None


def write_answer(problem: Problem | None) -> None:
    """Write the answer into the working directory: None when the results are complete."""
    content: dict[str, Any] = {"problem": None}
    if problem is not None:
        fields = problem.model_dump(exclude_none=True, include=set(_Problem.model_fields))
        content["problem"] = {**fields, "detail": problem.detail[:MAX_DETAIL]}
    Path(ANSWER_FILE).write_text(json.dumps(content))


@dataclass(frozen=True, slots=True)
class JobAnswer:
    """problem : None when the process says that its results are complete"""

    problem: Problem | None


def read_answer(folder: Path) -> JobAnswer | None:
    """The answer of an ended process; None when there is none, or none that this program writes."""
    content = read_regular_file(folder / ANSWER_FILE, MAX_ANSWER_BYTES + 1)
    if content is None or len(content) > MAX_ANSWER_BYTES:
        return None
    try:
        answer = _Answer.model_validate_json(content)
    except pydantic.ValidationError:
        return None
    if answer.problem is None:
        return JobAnswer(None)
    known = PROBLEM_CODES.get(answer.problem.code)
    if known != (answer.problem.type, answer.problem.title, answer.problem.status):
        return None
    return JobAnswer(Problem.model_validate(answer.problem.model_dump(exclude_none=True)))


def read_regular_file(path: Path, max_bytes: int, *, end: bool = False) -> bytes | None:
    """Up to `max_bytes` from the start or the end of a file that a job wrote; None if it is none."""
    file = open_regular_file(path)
    if file is None:
        return None
    with file:
        if end:
            file.seek(max(0, os.fstat(file.fileno()).st_size - max_bytes))
        return file.read(max_bytes)
