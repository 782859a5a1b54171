"""Changes of any mesh, also of a real one."""

import numpy as np

from pipeline.core.mesh import Mesh
from tests.support.variants import solids

#: Gap between a part and a further body beside it, share of the diagonal.
BODY_GAP_SHARE = 0.04
#: Radius and length of the further body, a pin, shares of the diagonal.
PIN_RADIUS_SHARE, PIN_LENGTH_SHARE = 0.04, 0.25


def stretched(mesh: Mesh, axis: int, share: float) -> Mesh:
    """Longer by `share` along one axis, about the middle of the bounding box."""
    factor = np.ones(3)
    factor[axis] += share
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    return Mesh(middle + (mesh.vertices - middle) * factor, mesh.faces)


def longest_axis(mesh: Mesh) -> int:
    """The axis along which the bounding box is longest."""
    return int(np.argmax(np.ptp(mesh.vertices, axis=0)))


def scaled_to(mesh: Mesh, diagonal_mm: float) -> Mesh:
    """Scaled in all axes, about the origin, to a bounding box of this diagonal."""
    return Mesh(mesh.vertices * (diagonal_mm / mesh.diagonal_mm), mesh.faces)


def mirror_image(mesh: Mesh, axis: int) -> Mesh:
    """Reflected at the plane through the middle of the bounding box; normals stay outward."""
    sign = np.ones(3)
    sign[axis] = -1.0
    middle = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    return Mesh(middle + (mesh.vertices - middle) * sign, mesh.faces[:, ::-1])


def with_pin(mesh: Mesh) -> Mesh:
    """With a second body: a closed pin that lies along x beside the part, at its low end of y and z."""
    size, low = mesh.diagonal_mm, mesh.vertices.min(axis=0)
    radius = PIN_RADIUS_SHARE * size
    pin = solids.z_to_x(solids.cylinder((0.0, 0.0), radius, 0.0, PIN_LENGTH_SHARE * size))
    place = low + np.array([0.1 * size, -radius - BODY_GAP_SHARE * size, radius])
    return solids.joined(mesh, Mesh(pin.vertices + place, pin.faces))
