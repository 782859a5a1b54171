"""The options of a job: checked before anything is stored; an error names the wrong key."""

import json
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, JsonValue, ValidationError

from pipeline import Settings
from service.ceilings import setting_value
from service.contract.errors import BadRequest, InvalidOptions, InvalidRequest
from service.contract.invalid_values import plain, problem_item, problem_items, shown
from service.contract.schemas import Options, ProblemItem


def parse_options(document: object) -> Options:
    """`options` as sent (JSON text or its content), its settings included.

    Raises
    ------
    InvalidOptions, BadRequest
    """
    if isinstance(document, str | bytes):
        document = read_json(document, "options")
    if not isinstance(document, dict):
        item = problem_item("/options", f"must be a JSON object, not {shown(document)}")
        raise InvalidOptions(summarize([item]), errors=[item])
    try:
        options = Options.model_validate(document)
    except ValidationError as error:
        items = problem_items(error, ["options"], document, Options)
        raise InvalidOptions(summarize(items), errors=items) from error
    try:
        settings = resolve_settings(options)
    except ValidationError as error:
        items = problem_items(error, ["options", "settings"], merged_settings(options), Settings)
        raise InvalidOptions(summarize(items), errors=items) from error
    if len(set(settings.study.detectors)) < len(settings.study.detectors):
        where = (
            "study"
            if options.study is not None and "detectors" in options.study.model_fields_set
            else "settings/study"
        )
        item = problem_item(f"/options/{where}/detectors", "a detector is listed twice; list each once")
        raise InvalidOptions(summarize([item]), errors=[item])
    return options


def resolve_settings(options: Options) -> Settings:
    """The pipeline's settings: the preset, `settings` over it, `study` over those. Raises ValidationError."""
    return Settings.model_validate(merged_settings(options))


def merged_settings(options: Options) -> dict[str, Any]:
    """What `resolve_settings` checks."""
    settings = _merged(Settings.preset(options.preset).model_dump(), options.settings)
    if options.study is not None:
        settings = _merged(settings, {"study": options.study.model_dump(exclude_unset=True)})
    return settings


def check_ceilings(options: Options, ceilings: Mapping[str, float]) -> None:
    """Raise InvalidOptions, with the ceiling, for each setting above it."""
    settings = resolve_settings(options)
    items = []
    for name, ceiling in ceilings.items():
        value = setting_value(settings, name)
        if value is not None and value > ceiling:
            section, _, field = name.partition(".")
            where = f"/options/settings/{section}/{field}"
            if section == "study" and options.study is not None and field in options.study.model_fields_set:
                where = f"/options/study/{field}"
            items.append(
                problem_item(where, f"must be at most {plain(ceiling)} on this server, and is {plain(value)}")
            )
    if items:
        raise InvalidOptions(summarize(items), errors=items)


def invalid_request(error: ValidationError, document: object, model: type[BaseModel]) -> InvalidRequest:
    """The problem of a JSON body that does not match the schema of `model`."""
    items = problem_items(error, [], document, model)
    return InvalidRequest(summarize(items), errors=items)


def read_json(text: str | bytes, what: str) -> Any:
    """Parse JSON text. Raises BadRequest."""
    try:
        return json.loads(text)
    except ValueError as error:
        raise BadRequest(f"{what}: not JSON ({error}); send a JSON object") from error
    except RecursionError:
        raise BadRequest(f"{what}: JSON nested too deeply; send a JSON object") from None


def _merged(base: Mapping[str, Any], over: Mapping[str, JsonValue]) -> dict[str, Any]:
    """`base` updated with `over`, key by key in nested objects; the result is validated later."""
    merged = dict(base)
    for key, value in over.items():
        below = merged.get(key)
        merged[key] = _merged(below, value) if isinstance(below, dict) and isinstance(value, dict) else value
    return merged


def summarize(items: list[ProblemItem]) -> str:
    """`options.seed: must be ...`, for each; at most three."""
    details = [f"{item.pointer.removeprefix('/').replace('/', '.')}: {item.detail}" for item in items[:3]]
    return "; ".join(details) + (f"; and {len(items) - 3} more" if len(items) > 3 else "")
