"""Settings of tests: which record a test takes says what it is about."""

from typing import Any

from pipeline import Settings

#: For tests about status, files and wiring: the whole method on the small blobs of `meshes.py`, in about a
#: second.
FAST: dict[str, Any] = {
    "resample": {"target_vertices": 400},
    "features": {"target_vertices": 600},
    "matching": {"max_hypotheses": 8, "dense_pairs": False, "sample_points": 500},
    "registration": {"sample_points": 1000},
}
#: For tests that only ask whether a mesh gets through.
TINY: dict[str, Any] = {"resample": {"target_vertices": 200}, "features": {"target_vertices": 200}}
#: For tests that judge the method on shapes by formula: nothing is left out, only the meshes are coarser.
#: Tests take the default settings where the defaults themselves are judged.
COARSE = Settings.model_validate(
    {"resample": {"target_vertices": 2000}, "features": {"target_vertices": 3000}}
)
#: For jobs that are interrupted: half a minute and more.
LONG: dict[str, Any] = {"resample": {"target_vertices": 20_000}}
