"""What a result was computed from and with."""

from typing import Any

from pydantic import Field

from pipeline.core.results.base import Record


class Input(Record):
    sha256: str = Field(description="of the file, hex")
    format: str = Field(
        description="by its content: stl, ply, obj, off, 3mf, glb, xyz, step, las, e57, vtp, amf"
    )
    unit: str = Field(description="unit that its numbers were read in")
    mm_per_unit: float = Field(description="factor applied to them")
    part: str | None = Field(None, description="part of the file that was read, as in `options.design_part`")
    columns: str | None = Field(None, description="columns of a text of points, as in `options.columns`")
    cleaning: dict[str, int | float] = Field(description="what was removed or repaired, by kind, with counts")


class Inputs(Record):
    design: Input = Field(description="the design file")
    scan: Input = Field(description="the scan file")


class OneInput(Record):
    mesh: Input = Field(description="the mesh file")


class MadeBy(Record):
    """What a result was computed with."""

    version: str = Field(description="of Cusp")
    libraries: dict[str, str] = Field(description="versions of the libraries it computes with")
    settings: dict[str, Any] = Field(description="every setting of the method, as used")
    seed: int = Field(description="of every random draw")


class Provenance(MadeBy):
    inputs: Inputs = Field(description="the files")
    limits: dict[str, Any] = Field(
        default_factory=dict,  # results of version 0.1.0 have none
        description="every number that decides the pose or the verdict and is not in `settings`, by group",
    )


class OneProvenance(MadeBy):
    inputs: OneInput = Field(description="the file")
