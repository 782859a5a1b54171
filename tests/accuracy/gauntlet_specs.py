"""What the gauntlet is made of: shapes, conditions, and the list of its cases."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from pipeline.core.mesh import Mesh
from service.demo import arch as demo_arch
from tests.accuracy import symmetries
from tests.accuracy.bench import read
from tests.conftest import data_folder
from tests.support import shapes


@dataclass(frozen=True, slots=True)
class Condition:
    """noise, warp, crop : shares, of the diagonal and for `crop` of the scan; tolerance : RMS
    displacement that is right
    """

    noise: float = 0.001
    warp: float = 0.003
    crop: float = 0.0

    @property
    def tolerance(self) -> float:
        return max(0.01, 2 * self.warp)


CONDITIONS = {
    "clean": Condition(0.0, 0.0),
    "scan": Condition(),
    "crop 30 %": Condition(crop=0.30),
    "crop 55 %": Condition(crop=0.55),
    "rough": Condition(0.003, 0.01),
}
DEPTH_CAMERA_TOLERANCE = 0.05
#: 1 sigma of the camera of the pairs, as it is stated in half of the cases. The data say about 1 mm.
DEPTH_CAMERA_ACCURACY_MM = 1.0

ARCHES = tuple(
    f"dental/{name}"
    for name in ("arch_001C.ply", "arch_012C.ply", "arch_013C.ply", "arch_022C.ply", "arch_h1.obj")
)
MOLARS = tuple(f"dental/molar_{name}.obj" for name in ("B03", "D09", "H10"))
TOOTH, CAST = "dental/ofj_tooth_19.stl", "dental/cast_lower_a.obj"
SCANS = tuple(
    f"scans/{name}" for name in ("stanford_bunny.obj", "rocker_arm.obj", "fertility.off", "foot.stl")
)
BASE, UPPER_ARM, NIST = "cad/so101_base.stl", "cad/so101_upper_arm.stl", "cad/nist_am_artifact.stl"
FANDISK, FEATURETYPE, NUT = "cad/fandisk.obj", "cad/featuretype.stl", "cad/quality_nut.stl"
MOUNTING_PLATE, PLATE_HOLES, BAR = (
    "cad/so101_mounting_plate.stl",
    "cad/plate_holes.stl",
    "cad/tensile_blank.stl",
)
RING_TOP, CONE = "cad/ring_fixed_top.ply", "cad/lattice_cone.stl"
PAIRS = ("pendulum", "separator", "square_peg")
RACK_TEETH, RACK_PITCH_MM, GEAR_TEETH = 30, 3.0, 36
FINE_PITCH = ("formula/rack", "formula/gear")
PAIR_CADS = tuple(f"pairs/{name}/cad_mm.stl" for name in PAIRS)

UNIQUE = (*ARCHES, *MOLARS, TOOTH, CAST, *SCANS, FANDISK, FEATURETYPE, BASE, UPPER_ARM, NIST, NUT)
NEARLY_SYMMETRIC = (MOUNTING_PLATE, PLATE_HOLES)
SYMMETRIC = (BAR, RING_TOP, CONE, *PAIR_CADS, "formula/n-fold ring")
SYMMETRIC_TO_THE_MESH = (RING_TOP, CONE, BAR)  # or so plain that `ambiguous` is no fault
MAY_REPEAT = (FANDISK, FEATURETYPE, BASE, UPPER_ARM, NIST, NUT, *NEARLY_SYMMETRIC, *SYMMETRIC)
MIRRORABLE = (*ARCHES, *MOLARS, TOOTH, CAST, FANDISK, UPPER_ARM, "scans/rocker_arm.obj", "scans/foot.stl")
HARDLY_MIRRORED = (
    NIST,
    "scans/fertility.off",
    ARCHES[0],
)  # from a rough scan their handedness can hardly be told
IN_MM = (ARCHES[0], ARCHES[4], CAST, TOOTH, UPPER_ARM, NIST)  # where other units make sense
STRANGERS = (
    *((BASE, UPPER_ARM), (UPPER_ARM, BASE), (FANDISK, FEATURETYPE), (NIST, MOUNTING_PLATE), (NUT, FANDISK)),
    *(
        (MOLARS[0], MOLARS[1]),
        (MOLARS[2], MOLARS[0]),
        (TOOTH, MOLARS[1]),
        (ARCHES[0], CAST),
        (SCANS[0], SCANS[2]),
    ),
    *((PAIR_CADS[0], PAIR_CADS[1]), ("formula/blob", SCANS[3])),
)
PATIENTS = tuple(
    (ARCHES[i], ARCHES[j]) for i, j in ((0, 1), (0, 3), (3, 0), (1, 2), (2, 4), (4, 3), (3, 2), (4, 0))
)
IN_PIECES = 3  # every so manieth other patient's arch is cropped by 30 %


def _arch() -> Mesh:
    arch = demo_arch.arch()
    return Mesh(arch.vertices, arch.faces)


def _body_of_revolution() -> Mesh:
    """A smooth closed vase about z: a sphere whose radius follows the height."""
    sphere = shapes.icosphere(1.0, 5)
    cosine = sphere.vertices[:, 2]
    radius = 20 * (1 + 0.25 * cosine + 0.18 * np.cos(3 * np.arccos(np.clip(cosine, -1, 1))))
    return Mesh(radius[:, None] * sphere.vertices * [1.0, 1.0, 1.5], sphere.faces)


def _n_fold_ring(n: int = 8) -> Mesh:
    """A smooth wavy ring about z, its own image after each of n turns, and upside down after none."""
    torus = shapes.torus(20.0, 5.0, around=192, across=48)
    angle = np.arctan2(torus.vertices[:, 1], torus.vertices[:, 0])
    middle = 20.0 * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    wave = np.cos(n * angle)
    vertices = middle + (torus.vertices - middle) * (1 + 0.25 * wave)[:, None]
    return Mesh(vertices + np.array([0.0, 0.0, 1.0]) * (1.5 * wave)[:, None], torus.faces)


FORMULAS: dict[str, Callable[[], Mesh]] = {
    "formula/demo arch": _arch,
    "formula/blob": lambda: shapes.bumpy_blob(5),
    "formula/body of revolution": _body_of_revolution,
    "formula/n-fold ring": _n_fold_ring,
    "formula/rack": shapes.rack,
    "formula/gear": lambda: shapes.gear(GEAR_TEETH),
    "formula/plane": lambda: shapes.grid_plane(61, 46, step_mm=2.0),
    "formula/sphere": lambda: shapes.icosphere(20.0, 5),
}


@dataclass(frozen=True, slots=True)
class Spec:
    """What a case is made from. scanned : the shape that is scanned, where it is another than the design"""

    group: str
    shape: str
    condition: str = "scan"
    seed: int = 0
    scanned: str | None = None

    @property
    def name(self) -> str:
        words = title(self.shape)
        if self.scanned is not None:
            words = f"{title(self.scanned)} on {words}"
        if self.group in {"inches", "metres"}:
            words += f" in {self.group}"
        if "mirrored" in self.group:
            words += " mirrored"
        if self.group.endswith("accuracy stated"):  # the same shapes and conditions run without it
            words += ", accuracy stated"
        return f"{words}, {self.condition}, seed {self.seed}"


def specs(seeds: int, first: int = 0) -> list[Spec]:
    """All cases, seed by seed; those on files only where `CUSP_DATA` is."""
    found = [spec for seed in range(first, first + seeds) for spec in of_seed(seed)]
    if data_folder() is not None:
        return found
    return [
        spec
        for spec in found
        if all(name.startswith("formula/") for name in (spec.shape, spec.scanned) if name)
    ]


def groups() -> list[str]:
    """All of them, in the order of the tables."""
    return list(dict.fromkeys(spec.group for spec in of_seed(0)))


def of_seed(seed: int) -> Iterator[Spec]:
    """The cases of one seed: printed parts, then simulated scanners."""
    from tests.accuracy.gauntlet_scanners import scanner_specs  # that module imports this one

    yield from _of_seed(seed)
    yield from scanner_specs(seed)


def _of_seed(seed: int) -> Iterator[Spec]:
    for condition in CONDITIONS:
        for shape in ("formula/demo arch", "formula/blob", *UNIQUE):
            yield Spec(condition, shape, condition, seed)
    for shape in SYMMETRIC:
        for condition in ("clean", "scan", "crop 30 %")[: 1 if shape == BAR else 3]:
            group = "featureless bar" if shape == BAR else "symmetric"
            yield Spec(group, shape, "scan" if shape == BAR else condition, seed)
    for shape in NEARLY_SYMMETRIC:
        for condition in CONDITIONS:
            yield Spec("nearly symmetric", shape, condition, seed)
    for shape in FINE_PITCH:
        for condition in ("clean", "scan", "crop 30 %", "crop 55 %"):
            yield Spec("fine pitch", shape, condition, seed)
    for pair in PAIRS:
        for kind in ("mesh", "points", "mesh, stated", "points, stated"):
            yield Spec("depth camera", f"pairs/{pair}", kind, seed)
    for design, scanned in STRANGERS:
        yield Spec("other part", design, "scan", seed, scanned)
    for number, (design, scanned) in enumerate(PATIENTS):
        condition = "crop 30 %" if number % IN_PIECES == IN_PIECES - 1 else "scan"
        yield Spec("another patient", design, condition, seed, scanned)
    for shape in MIRRORABLE:
        yield Spec("mirrored", shape, "scan", seed)
    for shape in HARDLY_MIRRORED:
        yield Spec("rough mirrored", shape, "rough", seed)
    for group in ("inches", "metres"):
        for shape in IN_MM:
            yield Spec(group, shape, "scan", seed)
    for condition in ("scan", "crop 30 %"):
        yield Spec("body of revolution", "formula/body of revolution", condition, seed)
    yield Spec("plane", "formula/plane", "scan", seed)
    yield Spec("sphere", "formula/sphere", "scan", seed)


def title(shape: str) -> str:
    path = Path(shape)
    return f"{path.parent.name} CAD" if path.stem == "cad_mm" else path.stem


@lru_cache(maxsize=64)
def design_of(shape: str) -> Mesh:
    if shape in FORMULAS:
        return FORMULAS[shape]()
    data = data_folder()
    assert data is not None, "specs() leaves out files where there are none"
    return read(data / shape)


@lru_cache(maxsize=64)
def self_maps(shape: str) -> tuple[symmetries.SelfMap, ...]:
    return tuple(symmetries.self_maps(design_of(shape))) if shape in MAY_REPEAT else ()


def mirrored(mesh: Mesh) -> Mesh:
    """x -> -x, triangles turned over so that normals stay outward."""
    return Mesh(mesh.vertices * [-1.0, 1.0, 1.0], mesh.faces[:, ::-1])
