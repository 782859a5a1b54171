"""What is wrong with each value of a request, in words for a person, with a JSON Pointer to it in the request
as it was sent.
"""

import json
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from service.contract.model_base import BLOB_ID, CURSOR, MESSAGE_CURSOR, NO_NUL, SHA256, VISIBLE_ASCII
from service.contract.problem import ProblemItem

MAX_DETAIL = 300  # characters
MAX_SHOWN = 60  # of a wrong value

PATTERNS = {
    BLOB_ID: "must be `sha256:` and 64 hex digits, as PUT /v1/blobs answers",
    SHA256: "must be 64 hex digits, 0 to 9 and a to f",
    CURSOR: "must be `next` of the page before, as the list gave it",
    MESSAGE_CURSOR: "must be the `id` of the last message of the page before",
    NO_NUL: "must not contain the character NUL",
    VISIBLE_ASCII: "must be ASCII without spaces",
}
NUMBER, WHOLE = "a number", "a whole number"
KINDS = {
    "float_parsing": NUMBER,
    "float_type": NUMBER,
    "finite_number": "a finite number",
    "int_parsing": WHOLE,
    "int_type": WHOLE,
    "int_from_float": WHOLE,
    "bool_parsing": "true or false",
    "bool_type": "true or false",
    "string_type": "text",
    "list_type": "a list",
    "tuple_type": "a list",
}
OBJECT_KINDS = ("model_type", "dict_type", "model_attributes_type", "dataclass_type")
BOUNDS = {
    "greater_than": ("gt", "above"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "below"),
    "less_than_equal": ("le", "at most"),
}
LENGTHS = {
    "too_short": ("min_length", "at least", "item"),
    "too_long": ("max_length", "at most", "item"),
    "string_too_short": ("min_length", "at least", "character"),
    "string_too_long": ("max_length", "at most", "character"),
}


def problem_items(
    error: ValidationError, prefix: Sequence[str], document: object, model: type[BaseModel]
) -> list[ProblemItem]:
    """Each wrong value once. prefix : where `document` is in the request; model : what it was read as"""
    items: dict[tuple[str, str], ProblemItem] = {}
    for each in error.errors(include_url=False):
        steps = _steps_in(document, each)
        is_meant = each["type"] not in OBJECT_KINDS  # which of several forms: what is no object tells nothing
        models = _models_at(model, each["loc"] if is_meant else steps)
        item = problem_item(_pointer([*prefix, *steps]), reason(each, models))
        items.setdefault((item.pointer, item.detail), item)
    return list(items.values())


def problem_item(pointer: str, detail: str) -> ProblemItem:
    """One wrong value. pointer : JSON Pointer to it in the request"""
    return ProblemItem(pointer=pointer, detail=detail[:MAX_DETAIL])


def reason(each: ErrorDetails, models: Sequence[type[BaseModel]] = ()) -> str:
    """What is wrong and what is allowed, to follow the name of the value and a colon. models : that may stand
    at its place; of an unknown key, that it was found in
    """
    kind, value, context = each["type"], each["input"], each.get("ctx", {})
    keys = list(dict.fromkeys(key for model in models for key in model.model_fields))
    if kind == "missing":
        return "missing, but required"
    if kind == "extra_forbidden":
        return f"unknown key; {_instead(str(each['loc'][-1]), keys)}" if keys else "unknown key"
    if kind in OBJECT_KINDS:
        form = f" ({', '.join(keys)})" if keys else ""
        return f"must be a JSON object{form}, not {shown(value)}"
    if kind in ("literal_error", "enum"):
        return f"must be {context['expected']}, not {shown(value)}"
    if kind == "union_tag_invalid":
        return (
            f"its {context['discriminator']} must be one of {context['expected_tags']}, not "
            f"'{context['tag']}'"
        )
    if kind == "union_tag_not_found":
        known = ", ".join(repr(name) for model in models for name in _names(model)[1:])
        return f"its {context['discriminator']} is missing{f'; known are {known}' if known else ''}"
    if kind in KINDS:
        return f"must be {KINDS[kind]}, not {shown(value)}"
    if kind in BOUNDS:
        name, words = BOUNDS[kind]
        return f"must be {words} {plain(context[name])}, not {shown(value)}"
    if kind in LENGTHS:
        name, words, what = LENGTHS[kind]
        count = context[name]
        return f"must have {words} {count} {what}{'' if count == 1 else 's'}, and has {len(value)}"
    if kind == "string_pattern_mismatch":
        return PATTERNS.get(context["pattern"], f"must match the pattern {context['pattern']}")
    return each["msg"].removeprefix("Value error, ").replace("Input should", "must")


def plain(number: float) -> str:
    """`5,000,000`, `0.5`"""
    return f"{number:,.10g}"


def shown(value: object) -> str:
    """A wrong value, in short."""
    if isinstance(value, dict):
        return "an object"
    if isinstance(value, list | tuple):
        return "a list"
    try:
        text = json.dumps(value, ensure_ascii=False)
    except (TypeError, ValueError):
        text = str(value)
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."


def _instead(key: str, keys: list[str]) -> str:
    near = get_close_matches(key, keys, n=1) or [each for each in keys if each.startswith(f"{key}_")]
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(keys)}"


def _pointer(steps: Sequence[object]) -> str:
    return "".join("/" + str(step).replace("~", "~0").replace("/", "~1") for step in steps)


def _steps_in(document: object, each: ErrorDetails) -> list[int | str]:
    """The path of an error without the names of alternatives, which the request does not have."""
    steps: list[int | str] = []
    for number, step in enumerate(each["loc"]):
        is_index = isinstance(document, list) and isinstance(step, int) and step < len(document)
        if is_index or (isinstance(document, dict) and step in document):
            document = document[step]  # type: ignore[index] # a list or a dictionary
            steps.append(step)
        elif each["type"] == "missing" and number == len(each["loc"]) - 1:
            steps.append(step)
    return steps


def _models_at(model: type[BaseModel], path: Sequence[int | str]) -> list[type[BaseModel]]:
    """The models that may stand at a path; where it names none further, those above."""
    models = [model]
    for step in path:
        below = [
            found
            for each in models
            if step in each.model_fields
            for found in _models_of(each.model_fields[str(step)].annotation)
        ]
        models = below or [each for each in models if step in _names(each)] or models
    return models


def _models_of(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_of(part)]


def _names(model: type[BaseModel]) -> list[str]:
    """What a path calls a model that is one of several: its class, or its kind."""
    kind = model.model_fields.get("kind")
    return [model.__name__, *(() if kind is None else get_args(kind.annotation))]
