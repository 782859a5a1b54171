"""Cases of the gauntlet made by the simulator of scanners, hard negatives, and thin walls.

- depth camera, simulated: one view, accuracy (1 sigma of range noise and distortion) 0.5 % or 1 % of the
  diagonal; `ok` and `uncertain` are both right, and what the seen piece does not hold (`_may_move`).
- depth camera, accuracy stated: the same at 1 %, with `scan_accuracy_mm`.
- structured light (0.05 %), dental scanner (0.1 %), CT (voxels of 0.5 %): `ok`.
- surroundings: a scan by structured light with a table, a clamp, supports or specks: as without them.
- other part, depth camera: another shape at the same size, with and without the accuracy stated; and other
  part, specks.
- variants: see `tests/support/variants`; the answers by the measured difference and the noise.
- thin walls: one or both sides of a cover of 0.5 to 3 mm; the right pose, or `ambiguous`.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache
from itertools import chain

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface
from tests.accuracy import gauntlet_specs as specs_of
from tests.accuracy.gauntlet_specs import Spec, design_of, self_maps
from tests.support import scanners
from tests.support.retriangulated import retriangulated
from tests.support.scanners import SURROUNDINGS, Camera, SimulatedScan
from tests.support.variants import catalogue, thin_walls
from tests.support.variants.expected import expected as expected_of
from tests.support.variants.record import Scope, Variant
from tests.support.variants.thin_cover import Faces

CAMERA, STATED = "depth camera, simulated", "depth camera, accuracy stated"
LIGHT, DENTAL, CT, AROUND = "structured light", "dental scanner", "CT", "surroundings"
OTHER_CAMERA, OTHER_SPECKS = "other part, depth camera", "other part, specks"
VARIANTS, WALLS = "variants", "thin walls"
GROUPS = (CAMERA, STATED, LIGHT, DENTAL, CT, AROUND, OTHER_CAMERA, OTHER_SPECKS, VARIANTS, WALLS)
#: Those that `confidence.py` fits on, with other seeds.
FITTED = (CAMERA, STATED, LIGHT, DENTAL, CT, OTHER_CAMERA)
#: 1 sigma over the diagonal of the design, by condition.
ACCURACY = {"camera 0.5 %": 0.005, "camera 1 %": 0.01, "light": 0.0005, "dental": 0.001}
VOXEL_SHARE = 0.005
#: RMS displacement that is right, of the diagonal: a camera's distortion moves the best pose.
TOLERANCE = {CAMERA: 0.05, STATED: 0.05}
#: Poses of a wall are right within this share of its thickness.
WALL_TOLERANCE = 0.3
WALL_NOISE_MM = thin_walls.NOISE_MM
WALL_EDGE_MM = 1.0
#: A view whose surface changes its distances by less than this share of a displacement does not hold it.
MAY_MOVE_SHARE = 0.12

FORMULAS = ("formula/demo arch", "formula/blob")
CLOSED = (
    *("formula/blob", specs_of.TOOTH, specs_of.BASE, specs_of.UPPER_ARM, specs_of.NIST, specs_of.FANDISK),
    *(specs_of.FEATURETYPE, specs_of.SCANS[1], specs_of.SCANS[2]),
)
BESIDE = ("formula/blob", specs_of.BASE, specs_of.UPPER_ARM, specs_of.NIST, specs_of.ARCHES[0])


def scanner_specs(seed: int) -> Iterator[Spec]:
    """The cases of one seed."""
    shapes = (*FORMULAS, *specs_of.UNIQUE, *specs_of.NEARLY_SYMMETRIC)
    for number, shape in enumerate(shapes):
        if number % 2 == seed % 2:
            yield Spec(CAMERA, shape, "camera 0.5 %", seed)
        yield Spec(CAMERA, shape, "camera 1 %", seed)
        yield Spec(STATED, shape, "camera 1 %", seed)
        yield Spec(LIGHT, shape, "light", seed)
    for shape in (*FORMULAS[:1], *specs_of.ARCHES, *specs_of.MOLARS, specs_of.CAST):
        yield Spec(DENTAL, shape, "dental", seed)
    for shape in CLOSED:
        yield Spec(CT, shape, "CT", seed)
    for shape in BESIDE:
        for kind in SURROUNDINGS:
            yield Spec(AROUND, shape, kind, seed)
    for design, scanned in specs_of.STRANGERS:
        yield Spec(OTHER_CAMERA, design, "camera 1 %", seed, scanned)
        yield Spec(OTHER_CAMERA, design, "camera 1 %, stated", seed, scanned)
        yield Spec(OTHER_SPECKS, design, "specks", seed, scanned)
    for family in catalogue.FAMILIES:
        for change in _changes(family, seed):
            yield Spec(VARIANTS, f"formula/{family}", change, seed)
    for wall_mm in thin_walls.WALLS_MM:
        for faces in Faces:
            for normals in thin_walls.Normals:
                yield Spec(WALLS, "formula/cover", f"{wall_mm:g} mm|{faces}|{normals}", seed)


Answer = dict[str, object]  # the fields of `gauntlet_cases.Case`


def answers(spec: Spec, rng: np.random.Generator) -> Answer:
    """The fields of the case of one of `scanner_specs`. rng : of this case"""
    makers: dict[str, Callable[[Spec, np.random.Generator], Answer]] = {
        OTHER_CAMERA: _other_part,
        OTHER_SPECKS: _other_part,
        VARIANTS: _variant,
        WALLS: _thin_wall,
    }
    return makers.get(spec.group, _scanned)(spec, rng)


def _scanned(spec: Spec, rng: np.random.Generator) -> Answer:
    design = design_of(spec.shape)
    scan = _scan_of(spec, design, design, rng)
    exact = [each.T for each in self_maps(spec.shape) if each.exact] or [np.eye(4)]
    statuses = {"ok"}
    if spec.group in TOLERANCE:
        statuses |= {"uncertain"} | _may_move(scan, design)
        if spec.shape in specs_of.MAY_REPEAT:  # one side of it may be the same from several sides
            statuses |= {"ambiguous"}
    if spec.shape in specs_of.NEARLY_SYMMETRIC:
        statuses |= {"ambiguous"}
    return {
        "design": design,
        "scan": scan.mesh,
        "truths": tuple(T @ scan.T_design_scan for T in exact),
        "expected": frozenset(statuses),
        "tolerance_share": TOLERANCE.get(spec.group, 0.01),
        "scan_accuracy_mm": scan.accuracy_mm if spec.group == STATED else None,
    }


def _scan_of(spec: Spec, design: Mesh, part: Mesh, rng: np.random.Generator) -> SimulatedScan:
    size_mm = design.diagonal_mm
    if spec.condition.startswith("camera"):
        accuracy_mm = ACCURACY[spec.condition.removesuffix(", stated")] * size_mm
        return scanners.depth_camera(part, Camera(accuracy_mm), rng)
    if spec.condition == "dental":
        return scanners.dental_scanner(part, ACCURACY["dental"] * size_mm, rng)
    if spec.condition == "CT":
        return scanners.ct(part, VOXEL_SHARE * size_mm, rng)
    scan = scanners.structured_light(part, ACCURACY["light"] * size_mm, rng)
    return scanners.with_surroundings(scan, spec.condition, rng) if spec.condition in SURROUNDINGS else scan


def _may_move(scan: SimulatedScan, design: Mesh) -> set[str]:
    """A view of a flat or a round side does not hold the part. Measured on the design itself: noise tilts the
    triangles, which looks like surface that holds.
    """
    from tests.accuracy.gauntlet_cases import moving_changes  # that module imports this one

    placed = rigid.transformed(scan.T_design_scan, scan.mesh.vertices)
    seen = Mesh(Surface(design).closest(placed).point, scan.mesh.faces)
    return {"under_constrained", "ambiguous"} if moving_changes(seen) < MAY_MOVE_SHARE else set()


def _other_part(spec: Spec, rng: np.random.Generator) -> Answer:
    assert spec.scanned is not None, "a stranger is another shape than the design"
    design, part = design_of(spec.shape), design_of(spec.scanned)
    part = Mesh(part.vertices * design.diagonal_mm / part.diagonal_mm, part.faces)
    scan = _scan_of(spec, design, part, rng)
    stated = spec.condition.endswith("stated")
    return {
        "design": design,
        "scan": scan.mesh,
        "truths": (),
        "expected": frozenset({"no_match"}),
        "tolerance_share": 0.05,
        "scan_accuracy_mm": scan.accuracy_mm if stated else None,
    }


def _changes(family: str, seed: int) -> Iterator[str]:
    """Names of the variants of one part, without making them."""
    yield from catalogue.FAMILIES[family](seed).changes()
    yield from ("second body missing", "extra body", "4.0 % longer", "0.2 % longer")
    if family in catalogue.MIRROR_AXIS:
        yield "mirror image"
    if family == "bolt":
        yield "next size"
    if family == "crown":
        yield "another tooth"
    yield from (f"{other} of its size" for other in catalogue.FAMILIES if other != family)


@lru_cache(maxsize=8)
def _variants_of(family: str, seed: int) -> dict[str, Variant]:
    made = chain(
        catalogue.feature_variants(family, seed),
        catalogue.shape_variants(family, seed),
        catalogue.stranger_variants(family, seed),
    )
    return {variant.name.split(", ", 1)[1]: variant for variant in made}


def _variant(spec: Spec, rng: np.random.Generator) -> Answer:
    variant = _variants_of(spec.shape.removeprefix("formula/"), spec.seed)[spec.condition]
    accuracy_mm = ACCURACY["light"] * variant.design.diagonal_mm
    scan = scanners.structured_light(variant.part, accuracy_mm, rng)
    answer = expected_of(variant, accuracy_mm)
    statuses = set(answer.statuses)
    if answer.is_visible and not answer.is_borderline:
        statuses -= {"ok"}
    posed = variant.T_design_part is not None and variant.scope is not Scope.MIRRORED
    if spec.condition == "extra body":  # it lies apart, and is left out with a warning
        statuses |= {"ok"}
    truths: tuple[FloatArray, ...] = ()
    if posed and not (answer.is_visible and variant.scope is Scope.GLOBAL):
        T = variant.T_design_part @ scan.T_design_scan
        truths = tuple(each @ T for each in _own_turns(spec.shape))
    return {
        "design": variant.design,
        "scan": scan.mesh,
        "truths": truths,
        "expected": frozenset(statuses),
        "tolerance_share": 0.01,
    }


def _own_turns(shape: str) -> list[FloatArray]:
    """Motions under which the part is its own image: a bolt turns by sixths about its axis, z."""
    turns = 6 if shape == "formula/bolt" else 1
    angles = 2 * np.pi / turns * np.arange(turns)
    matrices = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_matrix()
    return list(rigid.compose(matrices, np.zeros((turns, 3))))


def _thin_wall(spec: Spec, rng: np.random.Generator) -> Answer:
    wall, faces, normals = spec.condition.split("|")
    wall_mm = float(wall.removesuffix(" mm"))
    case = thin_walls.thin_wall_case(wall_mm, Faces(faces), thin_walls.Normals(normals), WALL_NOISE_MM)
    surface = case.scan_surface
    if not surface.is_cloud:  # a scanner's triangles are small, whatever those of the design are
        surface = retriangulated(surface, WALL_EDGE_MM)
    noise = rng.normal(0.0, WALL_NOISE_MM, (len(surface.vertices), 3))
    scan = SimulatedScan.posed(Mesh(surface.vertices + noise, surface.faces), WALL_NOISE_MM, rng)
    truths = [scan.T_design_scan]
    statuses = {"ok", "ambiguous", "uncertain", "under_constrained"}
    if not case.is_side_tellable:
        statuses -= {"ok"}
        if case.T_other_side is not None:
            truths.append(rigid.orthonormal(case.T_other_side @ scan.T_design_scan))
    return {
        "design": case.design,
        "scan": scan.mesh,
        "truths": tuple(truths),
        "expected": frozenset(statuses),
        "tolerance_share": WALL_TOLERANCE * wall_mm / case.design.diagonal_mm,
    }
