"""Which small motions of a rigid part a set of measured directions leaves free, without numpy: the service
checks alignments with it before a job is queued.

A small motion moves a point p by w x (p - c) + v: w (3,) rotation vector, v (3,) translation, c the centre.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pipeline.core.sentences import sentence

Vector = Sequence[float]
#: Share of its displacement (RMS over the points) that a motion must change the measured distances by, to
#: count as determined. Chosen by hand: below 1 % the points would have to be made a hundred times as well as
#: the part is placed.
DETERMINED_SHARE = 0.01
#: A rotation (or translation) below this share of the whole motion is left out of its name. Chosen by hand.
NAMED_SHARE = 1e-6
_SWEEPS = 60  # of the Jacobi iteration for 6 x 6; it converges in under ten


@dataclass(frozen=True, slots=True)
class SmallMotion:
    """axis : unit, of the rotation or along the translation; point_mm : on the axis of the rotation"""

    kind: Literal["rotation", "translation", "screw"]
    axis: tuple[float, float, float]
    point_mm: tuple[float, float, float]

    def __str__(self) -> str:
        along = f"({', '.join(f'{value:.3g}' for value in self.axis)})"
        if self.kind == "translation":
            return sentence("the translation along {axis}", axis=along)
        through = f"({', '.join(f'{value:.3g}' for value in self.point_mm)})"
        what = "rotation about" if self.kind == "rotation" else "screw motion about"
        return sentence(
            "the {motion} the axis {axis} through {place} mm", motion=what, axis=along, place=through
        )


def free_motions(positions: Sequence[Vector], directions: Sequence[Vector]) -> list[SmallMotion]:
    """The motions that move no point along its direction. positions : mm; directions : any length above 0"""
    centre = [sum(p[axis] for p in positions) / len(positions) for axis in range(3)]
    arms = [[p[axis] - centre[axis] for axis in range(3)] for p in positions]
    radius = math.sqrt(sum(_dot(arm, arm) for arm in arms) / len(arms)) or 1.0  # all in one place: any
    rows = []
    for arm, direction in zip(arms, directions, strict=True):
        length = math.sqrt(_dot(direction, direction))
        unit = [each / length for each in direction]
        rows.append([*(each / radius for each in cross(arm, unit)), *unit])
    gram = [[sum(row[i] * row[j] for row in rows) / len(rows) for j in range(6)] for i in range(6)]
    values, vectors = _eigen(gram)
    free = [vectors[k] for k in sorted(range(6), key=lambda k: values[k]) if values[k] < DETERMINED_SHARE**2]
    return named([[*(each / radius for each in vector[:3]), *vector[3:]] for vector in free], centre)


def named(twists: Sequence[Vector], centre: Vector) -> list[SmallMotion]:
    """Pure translations apart from the rest. twists : (k, 6) rotation vector (radians) and translation (mm)
    about the centre; any basis of the motions
    """
    rows = [list(twist) for twist in twists]
    scale = max((math.sqrt(_dot(row[:3], row[:3])) for row in rows), default=0.0)
    turning: list[list[float]] = []
    while rows:  # elimination of the rotations, the largest first
        row, axis = max(
            ((row, axis) for row in rows for axis in range(3)), key=lambda each: abs(each[0][each[1]])
        )
        if abs(row[axis]) <= max(NAMED_SHARE * scale, 1e-300):
            break
        rows.remove(row)
        pivot = [value / row[axis] for value in row]
        rows, turning = ([_without(each, pivot, axis) for each in group] for group in (rows, turning))
        turning.append(pivot)
    found = [_named(row, centre) for row in turning]
    return found + [SmallMotion("translation", _unit(row[3:]), _tuple(centre)) for row in _axes(rows)]


def _without(row: list[float], pivot: list[float], axis: int) -> list[float]:
    return [value - row[axis] * other for value, other in zip(row, pivot, strict=True)]


def _axes(rows: list[list[float]]) -> list[list[float]]:
    """The same translations along the axes of the frame, where they are."""
    rows = [list(row) for row in rows]
    found: list[list[float]] = []
    while rows:
        row, axis = max(
            ((row, axis) for row in rows for axis in range(3, 6)), key=lambda each: abs(each[0][each[1]])
        )
        if abs(row[axis]) <= 1e-12:
            break
        rows.remove(row)
        pivot = [value / row[axis] for value in row]
        rows, found = ([_without(each, pivot, axis) for each in group] for group in (rows, found))
        found.append(pivot)
    return found


def _named(row: list[float], centre: Vector) -> SmallMotion:
    turn, slide = row[:3], row[3:]
    squared = _dot(turn, turn)
    along = _dot(turn, slide) / squared
    offset = [each / squared for each in cross(turn, slide)]
    point = _tuple([centre[axis] + offset[axis] for axis in range(3)])
    aside = math.sqrt(_dot(slide, slide)) or 1.0
    pitch = abs(along) * math.sqrt(squared)
    return SmallMotion("screw" if pitch > 1e-3 * aside else "rotation", _unit(turn), point)


def cross(a: Vector, b: Vector) -> list[float]:
    """The cross product."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a: Vector, b: Vector) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _unit(vector: Vector) -> tuple[float, float, float]:
    """The largest component is positive: an axis has no direction."""
    length = math.sqrt(_dot(vector, vector)) * (1.0 if max(vector, key=abs) > 0 else -1.0)
    return _tuple([each / length for each in vector])


def _tuple(vector: Vector) -> tuple[float, float, float]:
    x, y, z = (round(each, 9) + 0.0 for each in vector)
    return x, y, z


def _eigen(matrix: list[list[float]]) -> tuple[list[float], list[list[float]]]:
    """Eigenvalues and eigenvectors (as rows) of a symmetric matrix: cyclic Jacobi rotations."""
    n = len(matrix)
    a = [list(row) for row in matrix]
    v = [[float(i == j) for j in range(n)] for i in range(n)]
    for _ in range(_SWEEPS):
        if sum(a[i][j] ** 2 for i in range(n) for j in range(i)) < 1e-30:
            break
        for p in range(n):
            for q in range(p + 1, n):
                if abs(a[p][q]) < 1e-300:
                    continue
                theta = (a[q][q] - a[p][p]) / (2 * a[p][q])
                t = math.copysign(1.0, theta) / (abs(theta) + math.hypot(theta, 1.0))
                c = 1 / math.hypot(t, 1.0)
                s = t * c
                for k in range(n):
                    a[k][p], a[k][q] = c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]
                for k in range(n):
                    a[p][k], a[q][k] = c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]
                    v[p][k], v[q][k] = c * v[p][k] - s * v[q][k], s * v[p][k] + c * v[q][k]
    return [a[i][i] for i in range(n)], v
