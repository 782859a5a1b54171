"""What lies around a part in a scan: a table, a clamp, supports, specks."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from tests.support import shapes
from tests.support.scanners.record import SimulatedScan, random_direction

#: Gap between the part and what lies beside it, of the diagonal.
GAP_SHARE = 0.04
#: Edge of the table, in diagonals of the part, and its squares along an edge.
TABLE_SIZE, TABLE_STEPS = 1.8, 60
#: Edge of the clamp, of the diagonal of the part.
CLAMP_SHARE = 0.25
#: Supports: how many, their radius and length, of the diagonal of the part.
SUPPORTS, SUPPORT_RADIUS_SHARE, SUPPORT_LENGTH_SHARE = 8, 0.008, 0.12
#: Specks: how many at most, their radius and their distance from the middle, in diagonals of the part.
SPECKS, SPECK_RADIUS_SHARE, SPECK_DISTANCE = 10, 0.006, (0.8, 4.0)


def table(scan: Mesh, rng: np.random.Generator) -> list[Mesh]:
    """A flat patch below the scan, apart from it."""
    return _table(scan, GAP_SHARE, rng)


def touching_table(scan: Mesh, rng: np.random.Generator) -> list[Mesh]:
    """A flat patch on which the lowest vertex of the scan lies."""
    return _table(scan, 0.0, rng)


def _table(scan: Mesh, gap_share: float, rng: np.random.Generator) -> list[Mesh]:
    """gap_share : between the lowest vertex and the patch, of the diagonal of the scan"""
    up = random_direction(rng)
    side = np.cross(up, np.eye(3)[int(np.abs(up).argmin())])
    side /= np.linalg.norm(side)
    grid = shapes.grid_plane(TABLE_STEPS, TABLE_STEPS, step_mm=TABLE_SIZE * scan.diagonal_mm / TABLE_STEPS)
    flat = grid.vertices - grid.vertices.mean(axis=0)
    low = float((scan.vertices @ up).min()) - gap_share * scan.diagonal_mm
    middle = scan.vertices.mean(axis=0)
    middle = middle + (low - middle @ up) * up
    return [Mesh(middle + flat @ np.stack([side, np.cross(up, side), up]), grid.faces)]


def clamp(scan: Mesh, rng: np.random.Generator) -> list[Mesh]:
    """A block beyond one end, apart from it."""
    along = random_direction(rng)
    edge = CLAMP_SHARE * scan.diagonal_mm
    end = scan.vertices[int((scan.vertices @ along).argmax())]
    ball = shapes.icosphere(0.5 * edge, 3)  # a rounded block
    block = np.sign(ball.vertices) * np.abs(ball.vertices / (0.5 * edge)) ** 0.4 * 0.5 * edge
    return [Mesh(end + (GAP_SHARE * scan.diagonal_mm + 0.9 * edge) * along + block, ball.faces)]


def supports(scan: Mesh, rng: np.random.Generator) -> list[Mesh]:
    """Thin rods below, each ending shortly before the part."""
    up, size = random_direction(rng), scan.diagonal_mm
    low = np.argsort(scan.vertices @ up, kind="stable")[: len(scan.vertices) // 10]
    length = SUPPORT_LENGTH_SHARE * size
    rod = shapes.cylinder(SUPPORT_RADIUS_SHARE * size, length, 12, 9)
    side = np.cross(up, np.eye(3)[int(np.abs(up).argmin())])
    side /= np.linalg.norm(side)
    upright = rod.vertices @ np.stack([side, np.cross(up, side), up])
    feet = scan.vertices[np.sort(rng.permutation(low)[:SUPPORTS])]
    return [Mesh(foot - (length + 0.5 * GAP_SHARE * size) * up + upright, rod.faces) for foot in feet]


def specks(scan: Mesh, rng: np.random.Generator) -> list[Mesh]:
    """One to `SPECKS` small balls anywhere around."""
    size, found = scan.diagonal_mm, []
    for _ in range(int(rng.integers(1, SPECKS + 1))):
        ball = shapes.icosphere(SPECK_RADIUS_SHARE * size, 1)
        off: FloatArray = rng.uniform(*SPECK_DISTANCE) * size * random_direction(rng)
        found.append(Mesh(scan.vertices.mean(axis=0) + off + ball.vertices, ball.faces))
    return found


SURROUNDINGS: dict[str, Callable[[Mesh, np.random.Generator], list[Mesh]]] = {
    "table": table,
    "clamp": clamp,
    "supports": supports,
    "specks": specks,
}
#: Not apart from the part, so no list of cases takes them unasked.
TOUCHING: dict[str, Callable[[Mesh, np.random.Generator], list[Mesh]]] = {"touching table": touching_table}


def with_surroundings(scan: SimulatedScan, kind: str, rng: np.random.Generator) -> SimulatedScan:
    """The scan with `kind` of `SURROUNDINGS` or `TOUCHING`; `is_part` says which vertices are the part's."""
    added = joined([scan.mesh, *(SURROUNDINGS | TOUCHING)[kind](scan.mesh, rng)])
    is_part = np.zeros(len(added.vertices), dtype=np.bool_)
    is_part[: len(scan.mesh.vertices)] = scan.is_part
    return replace(scan, mesh=added, is_part=is_part)


def joined(meshes: list[Mesh]) -> Mesh:
    """All of them in one mesh, in order; a cloud stays a cloud."""
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    if meshes[0].is_cloud:
        return Mesh(vertices)
    start = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    faces = [mesh.faces + first for mesh, first in zip(meshes, start, strict=True)]
    return Mesh(vertices, np.concatenate(faces).astype(np.int32))
