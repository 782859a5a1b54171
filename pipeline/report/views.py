"""The named views of a part, the same in the report and on the page (`service/web/views.js`): along the axes
of the design's file, and one oblique.
"""

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results.base import Vector3
from pipeline.report.numbers import MINUS
from pipeline.report.render import View

#: Name: from which side the eye looks at the part. Chosen by hand.
DIRECTIONS: dict[str, Vector3] = {
    "+z": [0, 0, 1],
    f"{MINUS}z": [0, 0, -1],
    "+x": [1, 0, 0],
    f"{MINUS}x": [-1, 0, 0],
    "+y": [0, 1, 0],
    f"{MINUS}y": [0, -1, 0],
    "oblique": [0.6, -0.8, 0.7],
}
#: A place is looked at from the front where the cosine of its normal with the view is above this.
MIN_FACING = 0.2


def named_view(name: str) -> View:
    """The view of this name."""
    up = [0.0, 1.0, 0.0] if name.endswith("z") else [0.0, 0.0, 1.0]
    return View.along(name, np.array(DIRECTIONS[name], dtype=np.float64), np.array(up))


def standard_views(mesh: Mesh) -> list[str]:
    """Four names: both flat sides of the part, oblique, and the side that shows most of the rest."""
    extents = np.ptp(mesh.vertices, axis=0)
    flat, middle = "xyz"[int(extents.argmin())], "xyz"[int(np.argsort(extents, kind="stable")[1])]
    return [f"+{flat}", "oblique", f"{MINUS}{flat}", f"{MINUS}{middle}"]


def views_facing(normal: FloatArray) -> list[str]:
    """The names of the views that look at a surface with this normal (3,), the most frontal first."""
    unit = normal / max(float(np.linalg.norm(normal)), 1e-12)
    cosines = {name: float(np.dot(unit, each) / np.linalg.norm(each)) for name, each in DIRECTIONS.items()}
    return sorted((name for name in cosines if cosines[name] > MIN_FACING), key=lambda name: -cosines[name])
