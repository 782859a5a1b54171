"""Every limit that decides a pose or a verdict is in the results, as JSON."""

import json
from dataclasses import fields, is_dataclass
from typing import Any

from pipeline.search import schedule
from pipeline.verification import thresholds
from pipeline.workflows.provenance import limits


def records(module: Any) -> list[Any]:
    """The default instances of the module's limit records."""
    return [value for value in vars(module).values() if is_dataclass(value) and not isinstance(value, type)]


def test_every_record_of_limits_is_in_the_provenance_whole() -> None:
    written = json.dumps(limits(), allow_nan=False)
    for record in (*records(schedule), *records(thresholds)):
        for field in fields(record):
            assert f'"{field.name}"' in written, f"{type(record).__name__}.{field.name}"


def test_the_limits_are_the_values_in_use() -> None:
    found = limits()
    assert found["search"]["matching"]["distinct_share"] == schedule.MATCHING.distinct_share
    assert found["verdict"]["thresholds"]["ambiguity"]["loose_fit_margin"] == 2.0
    for name in ("same_part", "pose"):
        weights = found["verdict"]["confidence"][name]["weights"]
        assert weights == getattr(thresholds.CONFIDENCE, name).weights
