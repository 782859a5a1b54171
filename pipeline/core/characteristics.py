"""What is kept with a design for all its scans: named regions, limits and the alignment."""

from collections.abc import Mapping
from typing import Self, TypeVar, cast

from pydantic import Field, model_validator

from pipeline.core.acceptance import (
    MAX_REGIONS,
    Acceptance,
    Length,
    Name,
    NamedRegion,
    OptionPart,
    Region,
    SurfaceRegion,
)
from pipeline.core.alignment import Alignment, BestFit, ConstrainedFit, limits_are_given

Given = TypeVar("Given", bound=OptionPart)


class DesignRegion(OptionPart):
    """A part of the design's surface with a name."""

    name: Name = Field(description='that limits and alignments refer to: `{"kind": "named", "name": ...}`')
    region: SurfaceRegion = Field(description="which part of the design's surface")


class Characteristics(OptionPart):
    """Of a design: each job on it takes what its own options do not state."""

    regions: list[DesignRegion] = Field([], max_length=MAX_REGIONS, description="regions with names")
    tolerance_mm: Length | None = Field(None, description="as `options.tolerance_mm`")
    acceptance: Acceptance | None = Field(None, description="as `options.acceptance`")
    alignment: Alignment | None = Field(None, description="as `options.alignment`")

    @model_validator(mode="after")
    def _agree(self) -> Self:
        names = [each.name for each in self.regions]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"the region {twice[0]!r} is given twice; names must differ")
        if self.acceptance is not None:
            with_named_regions(self.acceptance, self.by_name).with_tolerance(self.tolerance_mm)
        if self.alignment is not None:
            with_named_regions(self.alignment, self.by_name)
        if not limits_are_given(self.alignment, self.acceptance, self.tolerance_mm):
            raise ValueError("alignment: a tolerance_fit needs limits: its own, acceptance or tolerance_mm")
        return self

    @property
    def by_name(self) -> dict[str, Region]:
        """The regions."""
        return {each.name: each.region for each in self.regions}


def with_named_regions(given: Given, regions: Mapping[str, Region]) -> Given:
    """The same, each `named` region replaced by that of its name. Raises ValueError for an unknown name."""
    if not isinstance(given, Acceptance | BestFit | ConstrainedFit) or not given.regions:
        return given
    found = [each.model_copy(update={"region": _resolved(each.region, regions)}) for each in given.regions]
    return cast(Given, given.model_copy(update={"regions": found}))


def _resolved(region: Region, regions: Mapping[str, Region]) -> Region:
    if not isinstance(region, NamedRegion):
        return region
    if region.name not in regions:
        known = ", ".join(repr(name) for name in sorted(regions)) or "none"
        raise ValueError(
            f"no region is named {region.name!r}; the characteristics of the design have {known}"
        )
    return regions[region.name]
