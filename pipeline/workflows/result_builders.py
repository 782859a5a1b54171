"""From what the stages know to what a client reads: each function fills one part of `outcome.RegistrationResult`."""

from importlib.metadata import version
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray
from pipeline.core.results import (
    Alternative,
    FreeMotion,
    Input,
    Inputs,
    Landmark,
    Match,
    Metrics,
    Note,
    Observability,
    OneInput,
    OneProvenance,
    Provenance,
    Scale,
    Transform,
)
from pipeline.core.settings import Settings
from pipeline.kernels import rigid
from pipeline.stages.clean import Cleaned
from pipeline.stages.landmarks import LandmarkSet
from pipeline.stages.load import Loaded
from pipeline.stages.matching import Matching
from pipeline.stages.registration import Registration

_LIBRARIES = ("numpy", "open3d-cpu", "pymeshlab", "scikit-learn", "scipy", "trimesh", "weasyprint")


def transform(
    T_design_scan: FloatArray, design_mm_per_unit: float, scan: Loaded, unit_factor: float | None = None
) -> Transform:
    """unit_factor : of a `units_suspect` scan; `matrix` is of the scan so scaled, `matrix_file_to_file` includes it."""
    R, t = T_design_scan[:3, :3], T_design_scan[:3, 3]
    x, y, z, w = Rotation.from_matrix(R).as_quat()
    quaternion = np.array([w, x, y, z]) * (-1.0 if w < 0 else 1.0)
    # p_design_file = p_design_mm / mm_per_unit(design), p_scan_mm = p_scan_file * mm_per_unit(scan)
    file_to_file = T_design_scan.copy()
    file_to_file[:3, :3] *= (unit_factor or 1.0) * scan.mm_per_unit / design_mm_per_unit
    file_to_file[:3, 3] /= design_mm_per_unit
    return Transform(
        matrix=T_design_scan.tolist(),
        det=float(np.linalg.det(R)),
        rotation_deg=rigid.angle_deg(T_design_scan),
        quaternion_wxyz=quaternion.tolist(),
        translation_mm=t.tolist(),
        matrix_file_to_file=file_to_file.tolist(),
    )


def alternatives(
    registration: Registration, symmetric: tuple[bool, ...], *, rejected: bool
) -> list[Alternative]:
    """The other poses, best first, then the symmetries; without a pose to stand by also the best, which was rejected."""
    poses = [
        *([(registration.best, False)] if rejected else []),
        *zip(registration.rivals, symmetric, strict=True),
    ]
    best = registration.best.score_mm2
    return [
        Alternative(
            matrix=pose.T_design_scan.tolist(),
            score=pose.score_mm2 / best if best > 0 else 1.0,
            rmse_mm=pose.rmse_mm,
            symmetry_of_design=is_symmetry,
        )
        for pose, is_symmetry in poses
    ]


def metrics(registration: Registration, *, found: bool) -> Metrics:
    """What depends on the final transform is null when there is none."""
    under_final, rmse_landmarks = registration.fit, registration.rmse_landmarks_mm
    rmse_complete = registration.rmse_complete_mm
    return Metrics(
        rmse_initial_mm=registration.rmse_initial_mm,
        rmse_landmarks_mm=rmse_landmarks,
        rmse_complete_mm=rmse_complete,
        k_ratio=rmse_complete / rmse_landmarks if rmse_landmarks else None,
        rmse_mm=under_final.rmse_mm if found else None,
        inlier_rmse_mm=under_final.inlier_rmse_mm if found else None,
        inlier_distance_mm=registration.inlier_distance_mm,
        fitness=under_final.fitness if found else None,
        scan_overlap=under_final.overlap if found else None,
        design_coverage=registration.design_coverage if found else None,
        iterations=registration.best.iterations,
        converged=registration.best.converged,
    )


def matches(
    matching: Matching, design: LandmarkSet, scan: LandmarkSet, T_design_scan: FloatArray
) -> list[Match]:
    placed = rigid.transformed(T_design_scan, scan.position_mm[matching.scan])
    residual_mm = np.linalg.norm(placed - design.position_mm[matching.design], axis=1)
    return [
        Match(design=int(i), scan=int(j), residual_mm=float(r))
        for i, j, r in sorted(zip(matching.design, matching.scan, residual_mm, strict=True))
    ]


def observability(registration: Registration) -> Observability:
    seen = registration.observability
    smallest, largest = float(seen.eigenvalues[0]), float(seen.eigenvalues[-1])
    return Observability(
        eigenvalues=seen.eigenvalues.tolist(),
        condition_number=largest / smallest if smallest > 0 else None,
        free_motions=[
            FreeMotion(
                kind=motion.kind,
                axis=motion.axis.tolist(),
                point_mm=motion.point_mm.tolist(),
                sigma_mm=motion.sigma_mm,
            )
            for motion in seen.unconstrained
        ],
    )


def scale(registration: Registration, unit_factor: float | None) -> Scale:
    found = registration.scale
    per_axis = None if found.per_axis is None else found.per_axis.tolist()
    return Scale(isotropic=found.isotropic, per_axis=per_axis, warp_mm=found.warp_mm, unit_factor=unit_factor)


def input_record(loaded: Loaded, cleaned: Cleaned) -> Input:
    return Input(
        sha256=loaded.sha256,
        format=loaded.format.value,
        unit=loaded.unit,
        mm_per_unit=loaded.mm_per_unit,
        cleaning=cleaned.report,
    )


def input_warnings(**inputs: Cleaned) -> list[Note]:
    """What cleaning did that a person should look at."""
    notes = []
    for name, cleaned in inputs.items():
        dropped = int(cleaned.report.get("non_manifold_faces", 0))
        if dropped:
            detail = f"{name}: {dropped} triangles at edges shared by more than two were dropped"
            notes.append(Note(code="non_manifold", detail=detail))
        if cleaned.report.get("turned_faces", 0):
            detail = f"{name}: {cleaned.report['turned_faces']} triangles faced the wrong way and were turned"
            notes.append(Note(code="turned_faces", detail=detail))
        if cleaned.mesh.is_cloud:
            detail = (
                f"{name}: points without triangles; a surface was laid through them for the analysis only"
            )
            notes.append(Note(code="point_cloud", detail=detail))
    return notes


def landmark_warnings(**marked: list[Landmark]) -> list[Note]:
    """Meshes on which nothing stands out."""
    detail = "no landmarks: the surface has no relief at the scale of the features (features.radius_mm)"
    return [
        Note(code="no_landmarks", detail=f"{name}: {detail}") for name, found in marked.items() if not found
    ]


def provenance(inputs: Inputs, settings: Settings, seed: int) -> Provenance:
    return Provenance(inputs=inputs, **_made_by(settings, seed))


def one_provenance(mesh: Input, settings: Settings, seed: int) -> OneProvenance:
    return OneProvenance(inputs=OneInput(mesh=mesh), **_made_by(settings, seed))


def _made_by(settings: Settings, seed: int) -> dict[str, Any]:
    """The fields of `outcome.MadeBy`."""
    return {
        "version": version("cusp"),
        "libraries": {name: version(name) for name in _LIBRARIES},
        "settings": settings.model_dump(mode="json"),
        "seed": seed,
    }
