"""Calls of every function of the C++ core with arguments that are wrong in every way: each returns or raises.

    python -m tests.support.fuzzed_bindings [--count N] [--seed S] [--core FILE]

An access outside of an array ends this process, or is reported by the sanitizers if FILE is a core that was
built with them (`tests.support.sanitized_core`). Prints what the calls did.
"""

import argparse
import importlib.util
import itertools
import random
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

#: What a binding may raise.
REFUSALS = (ValueError, TypeError, IndexError, MemoryError, OverflowError)
NUMBERS = [0.0, -1.0, 1.0, 1e-300, 1e300, 1e74, float("inf"), float("-inf"), float("nan")]
INDICES = [-1, 0, 1, 7, 2**31 - 1, -(2**31), 2**62, -(2**62)]
COUNTS = [-1, 0, 1, 3]  # of iterations and the like: a large one takes long, and is no fault
THREADS = [-(2**31), -1, 0, 1, 2, 2**31 - 1]
SIZES = [-(2**31), -1, 0, 1, 40, 2**31 - 1]


@dataclass(frozen=True)
class Count:
    """An argument that says how often something is repeated."""

    value: int


@dataclass(frozen=True)
class Threads:
    """A number of threads."""

    value: int


@dataclass(frozen=True)
class Size:
    """An argument that memory is allocated for."""

    value: int


def grid_mesh(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (n, 3) and faces (m, 3) of a bumpy square."""
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    vertices = np.stack([x, y, np.sin(x * 1.3) * np.cos(y * 0.7)], axis=-1).reshape(-1, 3).astype(float)
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    below = np.stack([first, first + side, first + 1], axis=1)
    above = np.stack([first + 1, first + side, first + side + 1], axis=1)
    return vertices, np.concatenate([below, above]).astype(np.int32)


def valid_calls(core: Any) -> dict[str, tuple[Callable[..., Any], list[Any]]]:
    """By name: each binding, with arguments that it accepts."""
    vertices, faces = grid_mesh(6)
    n = len(vertices)
    corners = vertices[faces]
    lengths = np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2)
    normals = np.tile([0.0, 0.0, 1.0], (n, 1))
    poses, signs = np.tile(np.eye(4), (3, 1, 1)), np.ones(3)
    sources = np.array([0, 7, n - 1])
    weights = np.ones(n)
    low, shape = np.zeros(3), np.array([6, 6, 2])
    one = Threads(1)

    def solver(name: str, *arguments: Any) -> tuple[Callable[..., Any], list[Any]]:
        def call(faces: Any, lengths: Any, n: Any, *rest: Any) -> Any:
            return getattr(core.Solver(faces, lengths, n), name)(*rest)

        return call, [faces, lengths, Size(n), *arguments]

    def method(kind: str, name: str, built_of: int, *arguments: Any) -> tuple[Callable[..., Any], list[Any]]:
        def call(*given: Any) -> Any:
            return getattr(getattr(core, kind)(*given[:built_of]), name)(*given[built_of:])

        return call, list(arguments)

    nearest = core.nearest_of_cells(vertices, low, 1.0, shape, 3.0, 1)
    return {
        "Solver.distances": solver("distances", sources, 3.0, one),
        "Solver.distances_from_set": solver("distances_from_set", sources, 3.0),
        "Solver.between": solver("between", sources, sources[::-1].copy(), np.full(3, np.inf), one),
        "Solver.balls": solver("balls", sources, 2.0, one),
        "Solver.sums": solver("sums", weights, 1.0, 2.0, 0.5, one),
        "Solver.nearest_denser": solver("nearest_denser", sources, np.arange(n), 0.1, one),
        "Solver.nearest_other": solver(
            "nearest_other", sources, np.arange(n, dtype=np.int32) % 3, 3.0, 0.1, one
        ),
        "Solver.nearest": solver("nearest", sources, Size(4), one),
        "Solver.windows": solver("windows", Size(3), 2.0),
        "CopyIcp.align": method("CopyIcp", "align", 1, vertices, poses, Count(3), 1e-6, Count(5), one),
        "CopyIcp.rms_error": method("CopyIcp", "rms_error", 1, vertices, poses, poses.copy(), one),
        "SampleTarget.refine": method(
            "SampleTarget",
            "refine",
            2,
            *(vertices, normals, vertices + 0.1, normals.copy(), poses, signs, 1.0, 0.5, 0.01, Count(3), one),
        ),
        "SurfaceTarget.closest": method(
            "SurfaceTarget", "closest", 2, vertices, faces, vertices + 0.1, np.zeros(n, np.int64), one
        ),
        "SurfaceTarget.complete": method(
            "SurfaceTarget", "complete", 2, vertices, faces, vertices + 0.1, weights, Count(3), 1e-6
        ),
        "SurfaceTarget.refine": method(
            "SurfaceTarget",
            "refine",
            2,
            *(vertices, faces, vertices + 0.1, normals, weights, poses, signs),
            *(1.0, 3.0, 0.7, 0.5, 0.01, Count(3), Count(5), 1e-6, 0.01, Count(3), one),
        ),
        "nearest_of_cells": (core.nearest_of_cells, [vertices, low, 1.0, shape, 3.0, one]),
        "grid_costs": (
            core.grid_costs,
            [nearest, vertices, normals, low, 1.0, shape, poses, signs, vertices, normals, 1.0, 0.5, one],
        ),
        "edges": (core.edges, [faces, Size(n)]),
        "fpfh": (core.fpfh, [vertices, normals, sources, 2.0, one]),
        "agreeing_pairs": (
            core.agreeing_pairs,
            [vertices, normals, vertices + 0.1, normals.copy(), 0.1, 0.5, 0.1, 0.1, one],
        ),
        "distinct": (core.distinct, [poses, signs, vertices, 0.1, Count(3), poses.copy()]),
        "picture": (
            core.picture,
            [vertices, faces, vertices.copy(), -1.0, 6.0, 0.2, Size(40), Size(40), 0.3, 1.0, one],
        ),
        "isotropic": (core.isotropic, [vertices, faces, 0.6, 40.0, Count(2), one]),
    }


def names_of(core: Any) -> set[str]:
    """Every binding of the core."""
    found: set[str] = set()
    for name in (each for each in dir(core) if not each.startswith("_")):
        value = getattr(core, name)
        methods = [each for each in dir(value) if not each.startswith("_")] if isinstance(value, type) else []
        found |= {f"{name}.{each}" for each in methods} or {name}
    return found


def spoiled(value: Any, draw: random.Random) -> Any:
    """Something else in the place of the argument."""
    if isinstance(value, np.ndarray):
        return spoiled_array(value, draw)
    if isinstance(value, Count | Threads | Size):
        among = {Count: COUNTS, Threads: THREADS, Size: SIZES}[type(value)]
        return type(value)(draw.choice(among))
    return draw.choice(NUMBERS) if isinstance(value, float) else value


def spoiled_array(value: np.ndarray, draw: random.Random) -> Any:
    match draw.randrange(8):
        case 0:  # fewer rows
            return np.ascontiguousarray(value[: draw.randrange(len(value))])
        case 1:  # more rows
            return np.concatenate([value, value])
        case 2:  # another number of columns
            return np.ascontiguousarray(value[..., : draw.randrange(value.shape[-1])])
        case 3:
            return np.concatenate([value, value], axis=-1)
        case 4:
            return draw.choice([None, value.ravel(), value[..., None], value.astype(np.float16), 1.0, "x"])
        case 5:  # not in one piece
            return np.repeat(value, 2, axis=0)[::2]
        case _:
            changed = value.copy()
            flat = changed.reshape(-1)
            for _ in range(draw.choice([1, 1, 3, len(flat)])):
                at = draw.randrange(len(flat))
                with np.errstate(all="ignore"):
                    if changed.dtype.kind == "f":
                        flat[at] = draw.choice(NUMBERS)
                    else:
                        limits = np.iinfo(changed.dtype)
                        flat[at] = min(max(draw.choice(INDICES), limits.min), limits.max)
            return changed


def plain(value: Any) -> Any:
    return value.value if isinstance(value, Count | Threads | Size) else value


def fuzz(core: Any, count: int, seed: int) -> Counter[str]:
    """`count` calls of each binding; how often each returned and raised."""
    did: Counter[str] = Counter()
    for name, (call, arguments) in valid_calls(core).items():
        call(*map(plain, arguments))  # as they are, they are accepted
        for number in range(count):
            draw = random.Random(f"{seed}/{name}/{number}")
            given = list(arguments)
            for _ in range(draw.choice([1, 1, 2, 3])):
                at = draw.randrange(len(given))
                given[at] = spoiled(arguments[at], draw)
            try:
                call(*map(plain, given))
                did[f"{name} returned"] += 1
            except REFUSALS:
                did[f"{name} raised"] += 1
    return did


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--core", default="")
    given = parser.parse_args()
    if given.core:
        spec = importlib.util.spec_from_file_location("core", given.core)
        assert spec is not None and spec.loader is not None
        core = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(core)
    else:
        from pipeline.kernels.native import core
    missing = names_of(core) ^ set(valid_calls(core))
    assert not missing, f"bindings without a call here: {missing}"
    did = fuzz(core, given.count, given.seed)
    for name, times in itertools.islice(sorted(did.items()), 100):
        print(f"{name:40} {times}")


if __name__ == "__main__":
    main()
