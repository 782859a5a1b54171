"""Regions by faces of the CAD model, checked before a job is queued as far as the faces are known by then."""

from collections.abc import Iterator
from typing import Any

from pipeline import BrepFacesRegion, Format
from service.api.dependencies import Api
from service.contract.design_options import invalid_option, known_blob
from service.contract.schemas import Options

#: Names that an error lists, at most.
LISTED = 20


def check_faces(api: Api, tenant: str, options: Options, design: dict[str, Any]) -> None:
    """Raise InvalidOptions for a face that the design does not have: of a file of triangles, and of a design
    that was analysed before. design : input of the job
    """
    regions, blob = list(_by_faces(options)), known_blob(design)
    if not regions or blob is None:
        return
    stored = api.jobs.blob(blob, tenant)
    if stored is not None and stored.format != Format.STEP.value:
        what = "the file of the design has only triangles; send it as STEP, or give another kind of region"
        raise invalid_option(regions[0][0], what)
    names = api.design_faces.names(tenant, {**design, "blob": blob}, options.design_part)
    if names is None:
        return
    for pointer, region in regions:
        for face in region.faces:
            if face not in (range(len(names)) if isinstance(face, int) else names):
                shown = sorted({repr(name) for name in names if name})
                more = f" and {len(shown) - LISTED} more" if len(shown) > LISTED else ""
                listed = ", ".join(shown[:LISTED]) + more if shown else "none has a name"
                raise invalid_option(
                    pointer,
                    f"the design has no face {face!r}; it has {len(names)} (0 to {len(names) - 1}): {listed}",
                )


def _by_faces(options: Options) -> Iterator[tuple[str, BrepFacesRegion]]:
    for name in ("acceptance", "alignment"):
        for number, each in enumerate(getattr(getattr(options, name), "regions", [])):
            if isinstance(each.region, BrepFacesRegion):
                yield f"/options/{name}/regions/{number}/region/faces", each.region
