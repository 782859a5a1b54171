"""No argument makes the C++ core read or write outside of an array: it raises an error of Python."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.kernels.native import core
from tests.support import sanitized_core
from tests.support.fuzzed_bindings import grid_mesh, names_of, valid_calls

VERTICES, FACES = grid_mesh(4)
NORMALS = np.tile([0.0, 0.0, 1.0], (len(VERTICES), 1))
POSES = np.eye(4)[None]


def test_every_binding_is_fuzzed() -> None:
    assert names_of(core) == set(valid_calls(core))


def test_wrong_arguments_end_no_process() -> None:
    """In a process of its own, which a wrong access would end."""
    command = [sys.executable, "-m", "tests.support.fuzzed_bindings", "--count", "30"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout.count("raised") == done.stdout.count("returned") == len(names_of(core))


@pytest.mark.nightly
def test_the_sanitizers_find_nothing(tmp_path: Path) -> None:
    module = sanitized_core.build(tmp_path)
    done = sanitized_core.run(module, "--count", "2000", "--seed", "1")
    assert done.returncode == 0, done.stderr[-4000:]
    assert done.stdout.count("raised") == len(names_of(core))


def test_the_solver_checks_shapes_before_it_reads() -> None:
    with pytest.raises(ValueError, match=r"faces must be \(m, 3\)"):
        core.Solver(FACES[:, :1].copy(), np.ones((len(FACES), 3)), len(VERTICES))
    with pytest.raises(ValueError, match=r"lengths must be \(m, 3\)"):
        core.Solver(FACES, np.ones((1, 3)), len(VERTICES))
    with pytest.raises(IndexError, match="face out of range"):
        core.Solver(FACES, np.ones((len(FACES), 3)), 2)


def test_samples_are_checked_before_they_are_read() -> None:
    with pytest.raises(ValueError, match=r"points must be \(k, 3\)"):
        core.SampleTarget(VERTICES[:, :1].copy(), NORMALS)


def test_a_point_that_is_nowhere_is_refused() -> None:
    """Its closest face was number -1, and the face's normal was read."""
    lost = VERTICES.copy()
    lost[3, 1] = np.nan
    target = core.SurfaceTarget(VERTICES, FACES)
    weights, sign = np.ones(len(VERTICES)), np.ones(1)
    rules = (1.0, 3.0, 0.7, 0.5, 0.01, 3, 5, 1e-6, 0.01, 3, 1)
    with pytest.raises(ValueError, match="not finite"):
        target.refine(lost, NORMALS, weights, POSES, sign, *rules)
    with pytest.raises(ValueError, match="not finite"):
        core.SurfaceTarget(lost, FACES)
    # Poses that are finite may still lead to where squares are not: no face is found there.
    T, _, _ = target.refine(VERTICES * 1e74, NORMALS, weights, POSES * 1e74, sign, *rules)
    assert T.shape == (1, 4, 4)


def test_a_near_face_that_does_not_exist_is_refused() -> None:
    target = core.SurfaceTarget(VERTICES, FACES)
    for face in (-1, len(FACES), 2**40):
        with pytest.raises(IndexError, match="near face out of range"):
            target.closest(VERTICES, np.full(len(VERTICES), face), 1)


def test_a_grid_without_cells_is_refused() -> None:
    for shape in ([-1, -1, 4], [0, 1, 1], [2**40, 2**40, 2**40]):
        with pytest.raises(ValueError, match="grid"):
            core.nearest_of_cells(VERTICES, np.zeros(3), 1.0, np.array(shape), 3.0, 1)


def test_an_edge_too_small_for_the_mesh_is_refused() -> None:
    with pytest.raises(ValueError, match="too small"):
        core.isotropic(VERTICES, FACES, 1e-12, 40.0, 2, 1)
