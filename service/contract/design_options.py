"""The options of a job, completed by what is kept with its design."""

from typing import Any

from pydantic import ValidationError

from pipeline import Acceptance, Characteristics, ToleranceFit, limits_are_given, with_named_regions
from service.contract.errors import InvalidOptions
from service.contract.invalid_values import problem_item, problem_items
from service.contract.options import summarize
from service.contract.schemas import Options

TAKEN = ("tolerance_mm", "acceptance", "alignment")


def known_blob(source: dict[str, Any]) -> str | None:
    """Id of the content of an input of a job; None for an address without a digest."""
    if source.get("blob"):
        return str(source["blob"])
    return f"sha256:{source['sha256']}" if source.get("sha256") else None


def completed(options: Options, kept: Characteristics | None) -> Options:
    """Each of `TAKEN` that the job does not state is that of the design; named regions are replaced by what
    they stand for, so that a later change of the design's document does not change the job.

    Raises
    ------
    InvalidOptions
        For a region that the design does not name, limits that are nowhere, and where both together make no
        sense.
    """
    if kept is None and options.acceptance is None and options.alignment is None:
        return options
    changed: dict[str, Any] = {}
    for name in TAKEN:
        own, of_design = getattr(options, name), kept and getattr(kept, name)
        if own is None and of_design is not None:
            changed[name] = of_design
    changed |= _limits_of(options, kept)
    merged = options.model_copy(update=changed)
    regions = {} if kept is None else kept.by_name
    for name in ("acceptance", "alignment"):
        value = getattr(merged, name)
        if value is None:
            continue
        try:
            changed[name] = with_named_regions(value, regions)
        except ValueError as error:
            raise invalid_option(f"/options/{name}", str(error)) from error
    merged = merged.model_copy(update=changed)
    check_limits(merged)
    document = merged.model_dump(mode="json")
    try:
        return Options.model_validate(document)
    except ValidationError as error:
        items = problem_items(error, ["options"], document, Options)
        raise InvalidOptions(summarize(items), errors=items) from error


def check_limits(options: Options) -> None:
    """Raise InvalidOptions where a share of the area, or a fit to limits, has no limits to go by."""
    if options.acceptance is not None:
        try:
            options.acceptance.with_tolerance(options.tolerance_mm)
        except ValueError as error:
            raise invalid_option("/options/acceptance", str(error)) from error
    if not limits_are_given(options.alignment, options.acceptance, options.tolerance_mm):
        raise invalid_option(
            "/options/alignment", "a tolerance_fit needs limits: its own, acceptance or tolerance_mm"
        )


def _limits_of(options: Options, kept: Characteristics | None) -> dict[str, Acceptance | ToleranceFit]:
    """What the job states without limits, though it needs some, with those of the acceptance of the design: a
    share of the area, and a fit to limits.
    """
    own, of_design = options.acceptance, kept and kept.acceptance
    alignment = options.alignment or (kept and kept.alignment)
    if own is None or own.are_given or options.tolerance_mm is not None or not of_design:
        return {}
    if not of_design.are_given:
        return {}
    limits = {name: getattr(of_design, name) for name in ("tolerance_mm", "lower_mm", "upper_mm")}
    found: dict[str, Acceptance | ToleranceFit] = {}
    if own.min_within is not None:
        found["acceptance"] = own.model_copy(update=limits)
    elif isinstance(alignment, ToleranceFit) and not limits_are_given(alignment, own, None):
        found["alignment"] = alignment.model_copy(update=limits)
    return found


def invalid_option(pointer: str, detail: str) -> InvalidOptions:
    """The problem of one value. pointer : JSON Pointer to it in the request"""
    item = problem_item(pointer, detail)
    return InvalidOptions(summarize([item]), errors=[item])
