"""E57 (ASTM E2807): the points of all scans, as one cloud in the frame of the file, in metres.

Read by our own reader: the format is small, and what it says is untrusted. Colours, intensity and pictures
are not used.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.errors import MeshTooLarge, UnreadableFile
from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.e57_pages import read_pages
from pipeline.stages.load.e57_points import read_fields
from pipeline.stages.load.e57_xml import Scan, read_scans

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
INVALID = {CARTESIAN: "cartesianInvalidState", SPHERICAL: "sphericalInvalidState"}
#: Points at the origin of the scanner, from which on they are those without a return: one could be a point.
MIN_AT_ORIGIN = 2
#: Positions that a note lists.
MAX_LISTED = 5


@dataclass(frozen=True, slots=True, eq=False)
class _Read:
    """points : (n, 3) valid ones, frame of the file; n_invalid : marked so; n_at_origin : without a return"""

    points: FloatArray
    n_invalid: int
    n_at_origin: int


def read_e57(data: bytes, settings: LoadSettings) -> Contents:
    """One body for each scan, its pose applied, with the place of the scanner where the scan has a pose.

    Notes: `points_without_position`, `scanner_positions`, `pose_without_rotation`.

    Raises
    ------
    TruncatedFile, UnreadableFile, MeshTooLarge
        With the number of the scan.
    """
    pages = read_pages(data)
    scans = read_scans(pages.xml)
    count = sum(scan.count for scan in scans)
    if count > settings.max_points:
        raise MeshTooLarge(
            f"the E57 has {count} points in {len(scans)} scans; the limit is {settings.max_points}"
        )
    read = []
    for scan in scans:
        names = _coordinates(scan)
        wanted = {*names, INVALID[names]}
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is left out or refused
            values = read_fields(pages, scan.points_at, scan.count, scan.fields, wanted, scan.label)
            read.append(_placed(scan, names, values))
    bodies = [
        Body.cloud(each.points, scan.name, scan.translation if scan.has_position else None)
        for scan, each in zip(scans, read, strict=True)
        if len(each.points)
    ]
    if not bodies:
        raise UnreadableFile(f"the E57 has no valid points, of {count} in {len(scans)} scans")
    positions = np.array([scan.translation for scan in scans if scan.has_position]).reshape(-1, 3)
    notes = [*_invalid(read, count), *_rotations(scans), *_positions(positions, len(scans))]
    return Contents(tuple(bodies), "meter", tuple(notes))


def _coordinates(scan: Scan) -> tuple[str, str, str]:
    present = {field.name for field in scan.fields}
    for names in (CARTESIAN, SPHERICAL):
        if present.issuperset(names):
            return names
    raise UnreadableFile(f"the points of {scan.label} of the E57 have no coordinates that are complete")


def _placed(scan: Scan, names: tuple[str, str, str], values: dict[str, FloatArray]) -> _Read:
    """Points in the frame of the file, without invalid ones."""
    first, second, third = columns = [values[name] for name in names]
    state = values.get(INVALID[names])
    valid: BoolArray = np.ones(len(first), dtype=bool) if state is None else state == 0
    at_origin = valid.copy()
    for column in columns if names == CARTESIAN else [first]:
        valid &= np.isfinite(column)
        at_origin &= column == 0
    n_at_origin = int(at_origin.sum())
    if n_at_origin >= MIN_AT_ORIGIN:
        valid &= ~at_origin
    else:
        n_at_origin = 0
    first, second, third = columns if valid.all() else [column[valid] for column in columns]
    if names == SPHERICAL:  # section 5.5.3: azimuth from x to y, elevation from the xy plane
        reach = first * np.cos(third)
        local = np.stack([reach * np.cos(second), reach * np.sin(second), first * np.sin(third)])
    else:
        local = np.stack([first, second, third])
    if scan.has_rotation:
        local = _rotation(scan) @ local
    placed = np.ascontiguousarray((local + scan.translation[:, None]).T)
    return _Read(placed, len(valid) - len(placed) - n_at_origin, n_at_origin)


def _rotation(scan: Scan) -> FloatArray:
    """(3, 3) of the pose."""
    w, x, y, z = scan.quaternion
    matrix: FloatArray = Rotation.from_quat([x, y, z, w]).as_matrix()
    return matrix


def _invalid(read: list[_Read], count: int) -> list[Note]:
    n_invalid, n_origin = (sum(getattr(each, name) for each in read) for name in ("n_invalid", "n_at_origin"))
    parts = [f"{n_invalid} marked as invalid or not finite"] * (n_invalid > 0)
    parts += [f"{n_origin} exactly at the origin of their scan"] * (n_origin > 0)
    if not parts:
        return []
    detail = (
        f"the E57: {' and '.join(parts)} of {count} points have no position (no return of the scanner) and "
        "were left out; nothing else depends on them"
    )
    return [Note(code="points_without_position", detail=detail)]


def _rotations(scans: list[Scan]) -> list[Note]:
    odd = [scan.label for scan in scans if scan.has_zero_rotation]
    if not odd:
        return []
    detail = (
        f"the E57: the pose of {', '.join(odd[:MAX_LISTED])} has a rotation of zeros, which is none; it was "
        "read as no rotation: check that the scans fit together"
    )
    return [Note(code="pose_without_rotation", detail=detail)]


def _positions(positions: FloatArray, n_scans: int) -> list[Note]:
    if not len(positions):
        return []
    listed = ", ".join("({:.6g}, {:.6g}, {:.6g})".format(*row) for row in positions[:MAX_LISTED])
    more = f" and {len(positions) - MAX_LISTED} more" if len(positions) > MAX_LISTED else ""
    detail = (
        f"the E57: {n_scans} scan{'s were' if n_scans > 1 else ' was'} put in one frame by their poses; the "
        f"scanner stood at {listed}{more} m"
    )
    return [Note(code="scanner_positions", detail=detail)]
