"""What made a result: version, libraries, settings, and every limit that settings do not hold."""

import functools
from dataclasses import asdict
from typing import Any

from pipeline.core.code_fingerprint import versions_of, versions_of_formats
from pipeline.core.results import Input, Inputs, OneInput, OneProvenance, Provenance
from pipeline.core.settings import Settings
from pipeline.search import schedule
from pipeline.verification import thresholds

LIBRARIES = (
    "manifold3d",
    "numpy",
    "open3d-cpu",
    "pymeshlab",
    "scikit-learn",
    "scipy",
    "trimesh",
    "weasyprint",
)


def provenance(inputs: Inputs, settings: Settings, seed: int) -> Provenance:
    """Of a registration."""
    return Provenance(inputs=inputs, limits=limits(), **_made_by(settings, seed))


def one_provenance(mesh: Input, settings: Settings, seed: int) -> OneProvenance:
    """Of a job on one mesh."""
    return OneProvenance(inputs=OneInput(mesh=mesh), **_made_by(settings, seed))


def limits() -> dict[str, Any]:
    """The search's schedule and the verdict's limits, as JSON values."""
    return {
        "search": {
            "matching": asdict(schedule.MATCHING),
            "registration": asdict(schedule.REGISTRATION),
            "symmetry": asdict(schedule.SYMMETRY),
            "second": asdict(schedule.SECOND_SEARCH),
        },
        "verdict": {
            "thresholds": asdict(thresholds.VERDICT),
            "hypotheses": asdict(thresholds.HYPOTHESES),
            "confidence": asdict(thresholds.CONFIDENCE),
            "difference": asdict(thresholds.DIFFERENCE),
            "size": asdict(thresholds.SIZE),
        },
    }


@functools.cache
def versions() -> dict[str, str]:
    """Of this package, `LIBRARIES` and the installed packages for formats, looked up once per process."""
    return versions_of(("cusp", *LIBRARIES)) | versions_of_formats()


def _made_by(settings: Settings, seed: int) -> dict[str, Any]:
    """The fields of `core.results.MadeBy`."""
    return {
        "version": versions()["cusp"],
        "libraries": {name: number for name, number in versions().items() if name != "cusp"},
        "settings": settings.model_dump(mode="json"),
        "seed": seed,
    }
