"""A depth camera: one viewpoint, range noise, distortion of low order, smoothing, quantisation, flying
pixels.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.kernels import topology
from tests.support.scanners.rays import first_hits
from tests.support.scanners.record import SimulatedScan, random_direction

#: Distance of the camera from the middle of the part, in diagonals.
STAND_OFF = 4.0
#: Pixels across the diagonal of the part.
PIXELS = 150
#: Range noise of a pixel over the accuracy, drawn for each scan; distortion is the rest, so that the squares
#: of both sum to 1. Cameras' scatter is small beside their distortion (local fits: 0.05 to 0.1).
NOISE_SHARES = (0.05, 0.25)
#: Noise grows with 1 / cosine of incidence, up to this cosine.
MIN_COSINE = 0.3
#: Width of the filter over the depth image, pixels; a camera's own.
SMOOTHING_PIXELS = 1.5
#: Step of the depth over the range noise.
QUANTUM_SHARE = 0.3
#: Share of the pixels at a depth edge that lie between foreground and background.
FLYING_SHARE = 0.3
#: Depth difference of neighbours that ends the surface, in pixel widths and noise.
JUMP_PIXELS, JUMP_NOISES = 4.0, 6.0
#: Of what the camera looks at, share that shows the outside of an open part, in a view that is taken, of so
#: many tries. A print is solid behind an open surface: from behind, a camera would see what no design shows.
MIN_FRONT_SHARE, MAX_TRIES = 0.5, 100
#: Degree of the polynomial distortion of the depth over the image.
DISTORTION_DEGREE = 3


@dataclass(frozen=True, slots=True)
class Camera:
    """accuracy_mm : 1 sigma of range noise and distortion together, at the middle of the part; as_points : no
    triangles
    """

    accuracy_mm: float
    as_points: bool = False


def depth_camera(part: Mesh, camera: Camera, rng: np.random.Generator) -> SimulatedScan:
    """One view of `part` from a random direction, which sees the outside of an open part."""
    ticks = np.linspace(-0.5, 0.5, PIXELS) * part.diagonal_mm
    u, v = np.meshgrid(ticks, ticks, indexing="xy")
    distance_mm = STAND_OFF * part.diagonal_mm
    rays = np.stack([u, v, np.full_like(u, distance_mm)], axis=-1).reshape(-1, 3)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    centre = (part.vertices.min(axis=0) + part.vertices.max(axis=0)) / 2
    is_open = bool(topology.border_vertices(part.faces, len(part.vertices)).any())
    for _ in range(MAX_TRIES):
        looks = -random_direction(rng)
        # columns: right, down, forward
        across = Rotation.align_vectors([looks], [[0.0, 0.0, 1.0]])[0].as_matrix()
        eye = centre - distance_mm * looks
        range_mm, normals = first_hits(part, np.broadcast_to(eye, rays.shape), rays @ across.T)
        is_front = (not is_open) | (np.einsum("kd,kd->k", normals, rays @ across.T) < 0)
        if is_front.sum() >= MIN_FRONT_SHARE * np.isfinite(range_mm).sum():
            break
    else:
        raise ValueError("no view shows the outside of the part: its normals face inward")
    range_mm[~is_front] = np.inf
    cosine = np.abs(np.einsum("kd,kd->k", normals, rays @ across.T)).reshape(u.shape)
    depth = range_mm.reshape(u.shape)
    seen = np.isfinite(depth)
    noise_mm = rng.uniform(*NOISE_SHARES) * camera.accuracy_mm
    distortion_mm = float(np.sqrt(camera.accuracy_mm**2 - noise_mm**2))
    measured = _measured(depth, seen, cosine, distance_mm, noise_mm, distortion_mm, rng)
    if camera.accuracy_mm > 0:
        measured = _with_flying_pixels(measured, seen, part.diagonal_mm / PIXELS, rng)
    points = eye + (measured[..., None] * (rays @ across.T).reshape(*u.shape, 3))
    faces = _triangles(measured, seen, JUMP_PIXELS * part.diagonal_mm / PIXELS + JUMP_NOISES * noise_mm)
    return SimulatedScan.posed(_compact(points, seen, faces, camera.as_points), camera.accuracy_mm, rng)


def _measured(
    depth: FloatArray,
    seen: BoolArray,
    cosine: FloatArray,
    distance_mm: float,
    noise_mm: float,
    distortion_mm: float,
    rng: np.random.Generator,
) -> FloatArray:
    """(h, w) depth with noise, smoothed with it, distorted and quantised; where seen."""
    clean = np.where(seen, depth, 0.0)
    if noise_mm == 0:
        return clean
    sigma = noise_mm * (clean / distance_mm) ** 2 / np.maximum(cosine, MIN_COSINE)
    noise = rng.normal(size=depth.shape)
    weight = gaussian_filter(seen.astype(np.float64), SMOOTHING_PIXELS)
    smooth = gaussian_filter(np.where(seen, noise, 0.0), SMOOTHING_PIXELS) / np.maximum(weight, 1e-9)
    smooth /= max(float(smooth[seen].std()), 1e-9) if seen.any() else 1.0
    h, w = depth.shape
    y, x = np.meshgrid(np.linspace(-1, 1, h), np.linspace(-1, 1, w), indexing="ij")
    bent = np.zeros(depth.shape)
    for i in range(DISTORTION_DEGREE + 1):
        for j in range(DISTORTION_DEGREE + 1 - i):
            if i + j >= 2:  # lower terms are a motion
                bent += rng.normal() * x**i * y**j
    if seen.any():
        bent -= bent[seen].mean()
        bent *= distortion_mm / max(float(bent[seen].std()), 1e-9)
    quantum = QUANTUM_SHARE * noise_mm
    return np.asarray(np.round((clean + sigma * smooth + bent) / quantum) * quantum)


def _with_flying_pixels(
    depth: FloatArray, seen: BoolArray, pixel_mm: float, rng: np.random.Generator
) -> FloatArray:
    near = minimum_filter(np.where(seen, depth, np.inf), 3)
    far = maximum_filter(np.where(seen, depth, -np.inf), 3)
    at_edge = seen & (far - near > JUMP_PIXELS * 2 * pixel_mm)
    flying = at_edge & (rng.random(depth.shape) < FLYING_SHARE)
    share = rng.random(depth.shape)
    between = np.where(at_edge, near, 0.0) + share * np.where(at_edge, far - near, 0.0)
    return np.asarray(np.where(flying, between, depth))


def _triangles(depth: FloatArray, seen: BoolArray, jump_mm: float) -> FloatArray:
    h, w = depth.shape
    index = np.arange(h * w).reshape(h, w)
    a, b, c, d = (x.ravel() for x in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([b, d, c], 1)])
    corner = np.where(seen, depth, np.nan).ravel()[faces]
    with np.errstate(invalid="ignore"):
        whole = np.ptp(corner, axis=1) < jump_mm
    return np.asarray(faces[whole][:, ::-1])  # outward: towards the camera


def _compact(points: FloatArray, seen: BoolArray, faces: FloatArray, as_points: bool) -> Mesh:
    flat = points.reshape(-1, 3)
    if as_points:
        return Mesh(flat[seen.ravel()])
    used = np.unique(faces)
    number = np.full(len(flat), -1)
    number[used] = np.arange(len(used))
    return Mesh(flat[used], number[faces].astype(np.int32))
