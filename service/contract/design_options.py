"""The options of a job, completed by what is kept with its design."""

from typing import Any

from pydantic import ValidationError

from pipeline import Characteristics, with_named_regions
from service.contract.errors import InvalidOptions
from service.contract.options import problem_item, problem_items, summarize
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
        For a region that the design does not name, and where both together make no sense.
    """
    if kept is None and options.acceptance is None and options.alignment is None:
        return options
    changed = {}
    for name in TAKEN:
        own, of_design = getattr(options, name), kept and getattr(kept, name)
        if own is None and of_design is not None:
            changed[name] = of_design
    merged = options.model_copy(update=changed)
    regions = {} if kept is None else kept.by_name
    for name in ("acceptance", "alignment"):
        value = getattr(merged, name)
        if value is None:
            continue
        try:
            changed[name] = with_named_regions(value, regions)
        except ValueError as error:
            raise _invalid(f"/options/{name}", str(error)) from error
    merged = merged.model_copy(update=changed)
    try:
        return Options.model_validate(merged.model_dump(mode="json"))
    except ValidationError as error:
        items = problem_items(error, ["options"])
        raise InvalidOptions(summarize(items), errors=items) from error


def _invalid(pointer: str, detail: str) -> InvalidOptions:
    item = problem_item(pointer, detail)
    return InvalidOptions(summarize([item]), errors=[item])
