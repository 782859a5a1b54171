"""Printed parts that no limit was set on, seen by a depth camera of about 1 mm: `python -m
tests.accuracy.unseen_cameras --first-seed N`

Each part of `unseen_printed.py` from one random side, as triangles or points, with the accuracy stated and
without; and the next part of the list, at the same size, in its place. A line for each case, then counts.
"""

import argparse
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

import pipeline
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import rigid
from tests.accuracy import symmetries, unseen_printed
from tests.accuracy.gauntlet import run_cusp
from tests.accuracy.gauntlet_cases import Case
from tests.accuracy.gauntlet_rows import Row
from tests.support import scanners
from tests.support.scanners import Camera

ACCURACY_MM = 1.0
TOLERANCE_SHARE = 0.05
OF_REVOLUTION, TURNS = frozenset({"peg"}), 72


@dataclass(frozen=True, slots=True)
class View:
    """part : the design, or what is scanned in its place; is_stated : with `scan_accuracy_mm`"""

    design: str
    part: str
    seed: int
    is_stated: bool
    as_points: bool

    @property
    def name(self) -> str:
        shown = self.design if self.part == self.design else f"{self.part} on {self.design}"
        return ", ".join(
            [
                *(shown, f"seed {self.seed}"),
                *(["points"] if self.as_points else []),
                *(["stated"] if self.is_stated else []),
            ]
        )


def views(first_seed: int, seeds: int) -> Iterator[View]:
    """All of them; each part as points in every second seed."""
    names = list(unseen_printed.PARTS)
    for seed in range(first_seed, first_seed + seeds):
        for number, name in enumerate(names):
            for is_stated in (False, True):
                yield View(name, name, seed, is_stated, as_points=(number + seed) % 2 == 1)
            stranger = names[(number + 1 + seed) % len(names)]
            yield View(name, stranger, seed, is_stated=seed % 2 == 0, as_points=False)


@lru_cache(maxsize=32)
def part_of(name: str) -> Mesh:
    return unseen_printed.PARTS[name]()


@lru_cache(maxsize=32)
def self_maps(name: str) -> tuple[FloatArray, ...]:
    """Motions of the design that put it on itself."""
    if name not in OF_REVOLUTION:
        return tuple(each.T for each in symmetries.self_maps(part_of(name)) if each.exact)
    angles = 2 * np.pi * np.arange(TURNS) / TURNS
    turns = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_matrix()
    return tuple(rigid.compose(turns, np.zeros((TURNS, 3))))


def build(view: View) -> Case:
    """The same every time. A view without and with the accuracy stated is the same scan."""
    words = f"{view.design}|{view.part}"
    rng = np.random.default_rng([view.seed, zlib.crc32(words.encode())])
    design, part = part_of(view.design), part_of(view.part)
    if view.part != view.design:
        part = Mesh(part.vertices * design.diagonal_mm / part.diagonal_mm, part.faces)
    scan = scanners.depth_camera(part, Camera(ACCURACY_MM, as_points=view.as_points), rng)
    truths: tuple[FloatArray, ...] = ()
    if view.part == view.design:
        truths = tuple(T @ scan.T_design_scan for T in self_maps(view.design))
    return Case(
        *(view.name, "unseen cameras", design, scan.mesh, truths, frozenset({"ok", "uncertain"})),
        tolerance_share=TOLERANCE_SHARE,
        scan_accuracy_mm=ACCURACY_MM if view.is_stated else None,
    )


def line(row: Row) -> str:
    off = "" if row.error_share is None else f", {100 * row.error_share:.2f} % off"
    sure = "" if row.confidence is None else f", {row.confidence:.2f}"
    mark = "  WRONG OK" if row.wrong_but_ok else "  REFUSED" if row.right_but_refused else ""
    return f"{row.case}: {row.status}{sure}{off}, {row.cpu_s:.1f} s{mark}  {', '.join(row.findings)}"


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--parts", default="", help="only these designs, with commas")
    asked = parser.parse_args()
    wanted = set(asked.parts.split(",")) - {""} or set(unseen_printed.PARTS)
    pipeline.preload()
    counts: Counter[tuple[str, str, str]] = Counter()
    for view in views(asked.first_seed, asked.seeds):
        if view.design not in wanted:
            continue
        row = run_cusp(build(view))
        print(line(row), flush=True)
        kind = "other part" if view.part != view.design else "stated" if view.is_stated else "not stated"
        right = "no pose is right" if view.part != view.design else "right" if row.right else "wrong or none"
        counts[kind, right, row.status] += 1
    for (kind, right, status), count in sorted(counts.items()):
        print(f"{kind}, pose {right}: {count} {status}")


if __name__ == "__main__":
    main()
