"""A scan of one side of a thin wall lies on that side, whatever way its normals face."""

from pathlib import Path

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import rigid
from tests.support import shapes
from tests.support.registering import register
from tests.support.scans import save
from tests.support.settings import COARSE as QUICK
from tests.support.variants.thin_cover import Faces
from tests.support.variants.thin_walls import NOISE_MM, Normals, thin_wall_case

WALL_MM = 1.5


@pytest.mark.parametrize(
    ("faces", "normals"),
    [
        (Faces.INNER, Normals.REVERSED),
        *(
            pytest.param(faces, normals, marks=pytest.mark.nightly)
            for faces in (Faces.INNER, Faces.OUTER, Faces.BOTH)
            for normals in Normals
            if (faces, normals) != (Faces.INNER, Normals.REVERSED)
        ),
    ],
)
def test_a_scan_of_a_cover_is_not_one_wall_off(tmp_path: Path, faces: Faces, normals: Normals) -> None:
    case = thin_wall_case(WALL_MM, faces, normals)
    rng, T_scan_design = np.random.default_rng(0), shapes.motion(11)
    surface = case.scan_surface
    noise = rng.normal(0.0, NOISE_MM, (len(surface.vertices), 3))
    scan = Mesh(surface.vertices + noise, surface.faces).moved(T_scan_design)
    result = register(
        save(case.design, tmp_path / "design.ply"),
        save(scan, tmp_path / ("scan.xyz" if scan.is_cloud else "scan.ply")),
        settings=QUICK,
    )
    assert result.verdict.status in {"ok", "ambiguous", "uncertain"}
    assert result.transform is not None
    found, truth = np.array(result.transform.matrix), rigid.inverse(T_scan_design)
    off_mm = rigid.rms_displacement(found, truth, scan.vertices)
    assert off_mm < 0.3 * WALL_MM or result.verdict.status == "ambiguous"
