"""A picture of the README: `python -m tests.accuracy.picture demo .github/demo.png`.

Takes the folder that `cusp demo` wrote; draws the design with its segments and landmarks, the scan as
uploaded, and the aligned scan coloured by its deviation.
"""

import csv
import json
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import open3d as o3d
import trimesh

mpl.use("Agg")
import matplotlib.pyplot as plt

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels.surface import Surface

SIZE = (900, 700)
GREY = np.array([0.78, 0.77, 0.74])


def render(
    mesh: Mesh, colours: FloatArray, eye: FloatArray, target: FloatArray, up: FloatArray
) -> FloatArray:
    """(h, w, 4) picture by ray casting: vertex colours (n, 3), one light beside the camera, transparent
    behind.
    """
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(mesh.vertices.astype(np.float32), mesh.faces.astype(np.uint32))
    rays = scene.create_rays_pinhole(32, target, eye, up, *SIZE)
    hit = scene.cast_rays(rays)
    face, uv = hit["primitive_ids"].numpy(), hit["primitive_uvs"].numpy()
    seen = np.isfinite(hit["t_hit"].numpy())
    face = np.where(seen, face, 0)
    weights = np.stack([1 - uv.sum(axis=2), uv[..., 0], uv[..., 1]], axis=2)
    corners = mesh.faces[face]
    colour = np.einsum("hwc,hwcd->hwd", weights, colours[corners])
    normal = np.einsum("hwc,hwcd->hwd", weights, mesh.vertex_normals()[corners])
    light = (eye - target) / np.linalg.norm(eye - target) + 0.6 * up / np.linalg.norm(up)
    light = light / np.linalg.norm(light)
    shade = 0.35 + 0.65 * np.abs(normal @ light)
    return np.concatenate([np.clip(colour * shade[..., None], 0, 1), seen[..., None]], axis=2)


def read(path: Path) -> Mesh:
    loaded = trimesh.load(path, process=False)
    return Mesh(loaded.vertices, loaded.faces)


def column(path: Path, name: str) -> FloatArray:
    with path.open() as stream:
        return np.array([float(row[name]) for row in csv.DictReader(stream)])


def with_balls(
    mesh: Mesh, colours: FloatArray, points: FloatArray, radius_mm: float
) -> tuple[Mesh, FloatArray]:
    ball = trimesh.creation.icosphere(2, radius_mm)
    vertices, faces, painted = [mesh.vertices], [mesh.faces], [colours]
    for number, point in enumerate(points):
        vertices.append(ball.vertices + point)
        faces.append(ball.faces + len(mesh.vertices) + number * len(ball.vertices))
        painted.append(np.tile([0.05, 0.05, 0.05], (len(ball.vertices), 1)))
    return Mesh(np.concatenate(vertices), np.concatenate(faces)), np.concatenate(painted)


def main(folder: Path, out: Path) -> None:
    result = json.loads((folder / "results.json").read_text())
    design, scan, aligned = (
        read(folder / name) for name in ("design.clean.ply", "scan.clean.ply", "aligned.ply")
    )
    centre = design.vertices.mean(axis=0)
    up = np.array([0.0, 1.0, 0.35])
    eye = centre + np.array([0.0, -0.85, 1.15]) * 1.15 * design.diagonal_mm

    segment = column(folder / "design.vertices.csv", "segment").astype(int)
    palette = np.array(mpl.colormaps["tab20"].colors)
    position = np.array([landmark["position_mm"] for landmark in result["landmarks"]["design"]])
    analysed = render(*with_balls(design, palette[segment % 20], position, 0.6), eye, centre, up)

    both = Mesh(
        np.concatenate([design.vertices, scan.vertices]),
        np.concatenate([design.faces, scan.faces + len(design.vertices)]),
    )
    colours = np.concatenate(
        [np.tile(GREY, (len(design.vertices), 1)), np.tile([0.35, 0.55, 0.85], (len(scan.vertices), 1))]
    )
    middle = (both.vertices.min(axis=0) + both.vertices.max(axis=0)) / 2
    uploaded = render(
        both, colours, middle + (eye - centre) * both.diagonal_mm / design.diagonal_mm, middle, up
    )

    surface = Surface(design)
    signed = surface.signed_distance(aligned.vertices, surface.closest(aligned.vertices))
    limit = float(np.ceil(20 * np.quantile(np.abs(signed), 0.98)) / 20)
    colour = mpl.colormaps["RdBu_r"](0.5 + 0.5 * np.clip(signed / limit, -1, 1))[:, :3]
    deviation = render(aligned, colour, eye, centre, up)

    metrics = result["metrics"]
    figure, axes = plt.subplots(1, 3, figsize=(13.5, 4.1), layout="constrained")
    titles = [
        f"uploaded: RMSE {metrics['rmse_initial_mm']:.1f} mm",
        f"{result['segments']['design']['count']} segments, {len(position)} landmarks",
        f"registered: RMSE {metrics['rmse_mm']:.3f} mm, {len(result['landmarks']['matches'])} landmarks "
        "matched",
    ]
    for axis, image, title in zip(axes, (uploaded, analysed, deviation), titles, strict=True):
        axis.imshow(image)
        axis.set_title(title, fontsize=11)
        axis.axis("off")
    scale = mpl.cm.ScalarMappable(mpl.colors.Normalize(-limit, limit), "RdBu_r")
    figure.colorbar(scale, ax=axes[2], shrink=0.7, label="deviation of the print, mm (+ outside)")
    figure.savefig(out, dpi=110, metadata={"Software": None})


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
