"""Cases that nothing was set on: `python -m tests.accuracy.unseen [NAME ...]`

Parts of `unseen_shapes.py`, scanned by the simulated scanners, with surroundings, cut, changed, mirrored or
another part of the same size. A line for each: status, confidence, error, and whether the answer is right.
"""

import argparse
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

import pipeline
from pipeline.core.mesh import Mesh
from pipeline.kernels import rigid
from tests.accuracy import unseen_shapes as shapes
from tests.accuracy.gauntlet import run_cusp
from tests.accuracy.gauntlet_cases import Case
from tests.accuracy.gauntlet_specs import mirrored
from tests.support import scanners
from tests.support.scanners import Camera, SimulatedScan

LIGHT_SHARE, VOXEL_SHARE = 0.0005, 0.005
POSE, LOOSE_POSE = frozenset({"ok"}), frozenset({"ok", "uncertain", "ambiguous", "under_constrained"})
REFUSED, NOT_OK = frozenset({"no_match"}), LOOSE_POSE - {"ok"} | {"no_match"}


@dataclass(frozen=True, slots=True)
class Unseen:
    """part : what is scanned, None for the design itself; camera : accuracy over the diagonal, 0 for
    structured light, None for CT; crop : share that is cut off; around : of `scanners.with_surroundings`
    """

    design: Callable[[], Mesh]
    expected: frozenset[str]
    part: Callable[[], Mesh] | None = None
    camera: float | None = 0.0
    is_stated: bool = False
    as_points: bool = False
    crop: float = 0.0
    around: tuple[str, ...] = ()
    same_size: bool = False


CASES = {
    "knot on a table": Unseen(shapes.knot, POSE, around=("touching table",)),
    "knot, crop 60 %, specks": Unseen(shapes.knot, POSE, crop=0.6, around=("specks",)),
    "knot mirrored": Unseen(shapes.knot, frozenset({"mirrored"}), lambda: mirrored(shapes.knot())),
    "knot is another knot": Unseen(shapes.knot, REFUSED, lambda: shapes.knot(5), same_size=True),
    "knot, camera 1 %, stated": Unseen(shapes.knot, LOOSE_POSE, camera=0.01, is_stated=True),
    "another knot is the knot, camera 1 %, stated": Unseen(
        lambda: shapes.knot(5), REFUSED, shapes.knot, camera=0.01, is_stated=True, same_size=True
    ),
    "spring": Unseen(shapes.spring, POSE),
    "spring of the other hand": Unseen(
        shapes.spring, frozenset({"mirrored"}), lambda: shapes.spring(hand=-1)
    ),
    "spring with four turns": Unseen(shapes.spring, NOT_OK, lambda: shapes.spring(4)),
    "shaft": Unseen(shapes.shaft, POSE),
    "shaft without keyway": Unseen(shapes.shaft, NOT_OK, lambda: shapes.shaft(has_keyway=False)),
    "shaft, groove moved": Unseen(shapes.shaft, NOT_OK, lambda: shapes.shaft(groove_mm=31.5)),
    "shaft, longer": Unseen(shapes.shaft, NOT_OK, lambda: shapes.shaft(longer_mm=5.0)),
    "shaft, clamp, supports": Unseen(shapes.shaft, POSE, around=("clamp", "supports")),
    "hub, hole missing": Unseen(shapes.hub, NOT_OK, lambda: shapes.hub(missing=2)),
    "hub, ribs missing": Unseen(shapes.hub, NOT_OK, lambda: shapes.hub(has_ribs=False)),
    "hub, six holes": Unseen(shapes.hub, NOT_OK, lambda: shapes.hub(6)),
    "hub, camera 0.5 %, points, stated": Unseen(
        shapes.hub, LOOSE_POSE, camera=0.005, is_stated=True, as_points=True
    ),
    "bottle": Unseen(shapes.bottle, POSE),
    "bottle, camera 1 %": Unseen(shapes.bottle, LOOSE_POSE, camera=0.01),
    "tray": Unseen(shapes.tray, POSE),
    "tray, crop 40 %, table, specks": Unseen(shapes.tray, POSE, crop=0.4, around=("table", "specks")),
    "tray, CT": Unseen(shapes.tray, POSE, camera=None),
    "tray is the house": Unseen(shapes.tray, REFUSED, shapes.house, same_size=True),
    "house without chimney": Unseen(shapes.house, NOT_OK, lambda: shapes.house(has_chimney=False)),
    "house, window moved": Unseen(shapes.house, NOT_OK, lambda: shapes.house(window_mm=20.0)),
    "house, camera 1 %, stated, on a table": Unseen(
        shapes.house, LOOSE_POSE, camera=0.01, is_stated=True, around=("touching table",)
    ),
    "house is the tray, camera 1 %, stated": Unseen(
        shapes.house, REFUSED, shapes.tray, camera=0.01, is_stated=True, same_size=True
    ),
}


def build(name: str) -> Case:
    """The case of that name, the same every time."""
    made, rng = CASES[name], np.random.default_rng(zlib.crc32(name.encode()))
    design = made.design()
    part = design if made.part is None else made.part()
    if made.same_size:
        part = Mesh(part.vertices * design.diagonal_mm / part.diagonal_mm, part.faces)
    size_mm = design.diagonal_mm
    if made.camera is None:
        scan = scanners.ct(part, VOXEL_SHARE * size_mm, rng)
    elif made.camera:
        scan = scanners.depth_camera(part, Camera(made.camera * size_mm, as_points=made.as_points), rng)
    else:
        scan = scanners.structured_light(part, LIGHT_SHARE * size_mm, rng)
    scan = _cropped(scan, made.crop, rng) if made.crop else scan
    for kind in made.around:
        scan = scanners.with_surroundings(scan, kind, rng)
    truths = [scan.T_design_scan]
    if made.design is shapes.spring:  # half a turn about the axis through the middle of the wire
        turn = Rotation.from_rotvec([np.pi, 0.0, 0.0]).as_matrix()
        centre = np.array([0.0, 0.0, 7 * 5 / 2])
        truths.append(rigid.rotation_about(turn, centre, centre) @ scan.T_design_scan)
    return Case(
        *(name, "unseen", design, scan.mesh, () if made.part else tuple(truths), made.expected),
        tolerance_share=0.05 if made.camera else 0.01,
        scan_accuracy_mm=scan.accuracy_mm if made.is_stated else None,
    )


def _cropped(scan: SimulatedScan, share: float, rng: np.random.Generator) -> SimulatedScan:
    """Without that share of the vertices, by a plane."""
    height = scan.mesh.vertices @ rng.normal(size=3)
    kept = height < np.quantile(height, 1 - share)
    faces = scan.mesh.faces[kept[scan.mesh.faces].all(axis=1)]
    used = np.unique(faces)
    mesh = Mesh(scan.mesh.vertices[used], np.searchsorted(used, faces).astype(np.int32))
    return SimulatedScan(mesh, scan.T_design_scan, scan.accuracy_mm, scan.is_part[used])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*")
    names = parser.parse_args().names or list(CASES)
    pipeline.preload()
    for name in names:
        row = run_cusp(build(name))
        off = "" if row.error_share is None else f", {100 * row.error_share:.2f} % off"
        mark = "" if row.status in row.expected and not row.wrong_but_ok else "  UNEXPECTED"
        sure = "" if row.confidence is None else f", {row.confidence:.2f}"
        print(
            f"{name}: {row.status}{sure}{off}, {row.cpu_s:.1f} s{mark}  {', '.join(row.findings)}", flush=True
        )


if __name__ == "__main__":
    main()
