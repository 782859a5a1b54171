"""Every program at hand that writes mesh files: each format, option and byte order that it has.

Keys are (program, format, option). Each function writes `vertices` (n, 3), multiples of 1/8 and below 100, so
that none is rounded in single precision or in a text of six decimals, and `faces` (m, 3) to a path.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import lib3mf
import meshio
import numpy as np
import open3d
import plyfile
import pymeshlab
import stl
import trimesh

from pipeline.core.mesh import FloatArray, IntArray

Writer = Callable[[Path, FloatArray, IntArray], Any]
#: Surfaces.
MESH_WRITERS: dict[tuple[str, str, str], Writer] = {}
#: Points; `faces` is not used.
CLOUD_WRITERS: dict[tuple[str, str, str], Writer] = {}


def _trimesh(vertices: FloatArray, faces: IntArray) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False)


def _coloured(vertices: FloatArray, faces: IntArray) -> trimesh.Trimesh:
    mesh = _trimesh(vertices, faces)
    mesh.visual.vertex_colors = np.tile([10, 200, 30, 255], (len(vertices), 1))
    return mesh


def _scene(vertices: FloatArray, faces: IntArray) -> trimesh.Scene:
    """The mesh, moved by the transform of its node to where it is."""
    scene = trimesh.Scene()
    move = np.array([5.0, -3.0, 2.0])
    scene.add_geometry(
        _trimesh(vertices - move, faces), transform=trimesh.transformations.translation_matrix(move)
    )
    return scene


def _open3d(vertices: FloatArray, faces: IntArray, *, normals: bool = False) -> Any:
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(vertices.copy()), open3d.utility.Vector3iVector(faces.copy())
    )
    if normals:
        mesh.compute_vertex_normals()
        mesh.paint_uniform_color([1, 0, 0])
    return mesh


def _open3d_cloud(vertices: FloatArray, *, attributes: bool = False) -> Any:
    cloud = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(vertices.copy()))
    if attributes:
        cloud.normals = open3d.utility.Vector3dVector(np.tile([0.0, 0.0, 1.0], (len(vertices), 1)))
        cloud.paint_uniform_color([1, 0, 0])
    return cloud


def _meshlab(vertices: FloatArray, faces: IntArray | None = None) -> pymeshlab.MeshSet:
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices) if faces is None else pymeshlab.Mesh(vertices, faces))
    return meshes


def _plyfile(order: str, number: str, corner: str, count: str) -> Writer:
    def write(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        points = np.zeros(len(vertices), [(name, number) for name in "xyz"] + [("quality", "f4")])
        for k, name in enumerate("xyz"):
            points[name] = vertices[:, k]
        rows = np.zeros(len(faces), [("red", "u1"), ("vertex_index", corner, (3,))])
        rows["vertex_index"] = faces
        elements = [
            plyfile.PlyElement.describe(points, "vertex"),
            plyfile.PlyElement.describe(rows, "face", len_types={"vertex_index": count}),
        ]
        plyfile.PlyData(elements, text=order == "=", byte_order=order, comments=["TextureFile a.png"]).write(
            str(path)
        )

    return write


def _lib3mf(unit: str, *, components: bool) -> Writer:
    def write(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        library = lib3mf.get_wrapper()
        model = library.CreateModel()
        model.SetUnit(getattr(lib3mf.ModelUnit, unit))
        mesh = model.AddMeshObject()
        move = np.array([5.0, -3.0, 2.0]) if components else np.zeros(3)
        for point in (vertices - move).tolist():
            position = lib3mf.Position()
            position.Coordinates[:] = point
            mesh.AddVertex(position)
        for face in faces.tolist():
            triangle = lib3mf.Triangle()
            triangle.Indices[:] = face
            mesh.AddTriangle(triangle)
        if components:
            group = model.AddComponentsObject()
            group.AddComponent(mesh, library.GetTranslationTransform(*move.tolist()))
            model.AddBuildItem(group, library.GetIdentityTransform())
        else:
            model.AddBuildItem(mesh, library.GetIdentityTransform())
        model.QueryWriter("3mf").WriteToFile(str(path))

    return write


def _numpy_stl(mode: Any) -> Writer:
    def write(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        mesh = stl.mesh.Mesh(np.zeros(len(faces), dtype=stl.mesh.Mesh.dtype))
        mesh.vectors[:] = vertices[faces]
        mesh.save(str(path), mode=mode)

    return write


def _with_stl_attributes(path: Path, vertices: FloatArray, faces: IntArray) -> None:
    mesh = stl.mesh.Mesh(np.zeros(len(faces), dtype=stl.mesh.Mesh.dtype))
    mesh.vectors[:] = vertices[faces]
    mesh.attr[:, 0] = 0x801F
    mesh.save(str(path), mode=stl.Mode.BINARY)


def _meshio(kind: str, **options: Any) -> Writer:
    def write(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        meshio.Mesh(vertices, [("triangle", faces)]).write(str(path), kind, **options)

    return write


def _text(delimiter: str, *, header: str = "", comma: bool = False) -> Writer:
    def write(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        np.savetxt(path, vertices, fmt="%.6f", delimiter=delimiter, header=header)
        if comma:
            path.write_text(path.read_text().replace(".", ","))

    return write


for _kind in ("stl", "stl_ascii", "off", "glb", "3mf"):
    MESH_WRITERS["trimesh", _kind.partition("_")[0], _kind.partition("_")[2] or "default"] = (
        lambda path, vertices, faces, kind=_kind: _trimesh(vertices, faces).export(str(path), file_type=kind)
    )
MESH_WRITERS |= {
    ("trimesh", "ply", "binary"): lambda p, v, f: _trimesh(v, f).export(str(p), encoding="binary"),
    ("trimesh", "ply", "ascii"): lambda p, v, f: _trimesh(v, f).export(str(p), encoding="ascii"),
    ("trimesh", "ply", "binary, normals, colours"): lambda p, v, f: _coloured(v, f).export(
        str(p), vertex_normal=True
    ),
    ("trimesh", "obj", "default"): lambda p, v, f: _trimesh(v, f).export(str(p)),
    ("trimesh", "obj", "normals, colours"): lambda p, v, f: _coloured(v, f).export(
        str(p), include_normals=True, include_color=True
    ),
    ("trimesh", "off", "colours"): lambda p, v, f: _coloured(v, f).export(str(p)),
    ("trimesh", "glb", "colours"): lambda p, v, f: _coloured(v, f).export(str(p), include_normals=True),
    ("trimesh", "glb", "node with transform"): lambda p, v, f: _scene(v, f).export(str(p)),
    ("trimesh", "3mf", "item with transform"): lambda p, v, f: _scene(v, f).export(str(p)),
    ("meshio", "stl", "binary"): _meshio("stl", binary=True),
    ("meshio", "stl", "ascii"): _meshio("stl", binary=False),
    ("meshio", "ply", "binary"): _meshio("ply", binary=True),
    ("meshio", "ply", "ascii"): _meshio("ply", binary=False),
    ("meshio", "obj", "default"): _meshio("obj"),
    ("meshio", "off", "default"): _meshio("off"),
    ("numpy-stl", "stl", "binary"): _numpy_stl(stl.Mode.BINARY),
    ("numpy-stl", "stl", "ascii"): _numpy_stl(stl.Mode.ASCII),
    ("numpy-stl", "stl", "binary, attributes"): _with_stl_attributes,
    ("lib3mf", "3mf", "mm"): _lib3mf("MilliMeter", components=False),
    ("lib3mf", "3mf", "inch"): _lib3mf("Inch", components=False),
    ("lib3mf", "3mf", "components with transform"): _lib3mf("MilliMeter", components=True),
}
for _order, _called in (("<", "little endian"), (">", "big endian"), ("=", "ascii")):
    for _number, _corner, _count in (("f4", "i4", "u1"), ("f8", "u4", "i4"), ("f4", "u2", "u2")):
        MESH_WRITERS["plyfile", "ply", f"{_called}, {_number}, {_count} {_corner}"] = _plyfile(
            _order, _number, _corner, _count
        )
MESH_WRITERS["Open3D", "stl", "binary"] = lambda p, v, f: open3d.io.write_triangle_mesh(
    str(p), _open3d(v, f, normals=True)
)
for _kind in ("ply", "obj", "off", "glb"):
    for _normals in (False, True):
        for _ascii in (False, True) if _kind == "ply" else (False,):
            _option = ("ascii" if _ascii else "binary" if _kind == "ply" else "default") + (
                ", normals, colours" if _normals else ""
            )
            MESH_WRITERS["Open3D", _kind, _option] = lambda p, v, f, normals=_normals, is_ascii=_ascii: (
                open3d.io.write_triangle_mesh(str(p), _open3d(v, f, normals=normals), write_ascii=is_ascii)
            )
for _kind in ("stl", "ply"):
    for _binary in (True, False):
        MESH_WRITERS["pymeshlab", _kind, "binary" if _binary else "ascii"] = lambda p, v, f, binary=_binary: (
            _meshlab(v, f).save_current_mesh(str(p), binary=binary)
        )
for _kind in ("obj", "off"):
    MESH_WRITERS["pymeshlab", _kind, "default"] = lambda p, v, f: _meshlab(v, f).save_current_mesh(str(p))
    MESH_WRITERS["pymeshlab", _kind, "normals, colours"] = lambda p, v, f: _meshlab(v, f).save_current_mesh(
        str(p), save_vertex_color=True, save_vertex_normal=True, save_face_color=True
    )
MESH_WRITERS["pymeshlab", "ply", "binary, double, normals, colours"] = lambda p, v, f: _meshlab(
    v, f
).save_current_mesh(str(p), save_vertex_color=True, save_vertex_normal=True, save_face_color=True)

for _ascii in (False, True):
    for _attributes in (False, True):
        _option = ("ascii" if _ascii else "binary") + (", normals, colours" if _attributes else "")
        CLOUD_WRITERS["Open3D", "ply", _option] = lambda p, v, f, a=_attributes, is_ascii=_ascii: (
            open3d.io.write_point_cloud(str(p), _open3d_cloud(v, attributes=a), write_ascii=is_ascii)
        )
CLOUD_WRITERS |= {
    ("Open3D", "xyz", "default"): lambda p, v, f: open3d.io.write_point_cloud(str(p), _open3d_cloud(v)),
    ("Open3D", "xyzn", "normals"): lambda p, v, f: open3d.io.write_point_cloud(
        str(p), _open3d_cloud(v, attributes=True)
    ),
    ("Open3D", "xyzrgb", "colours"): lambda p, v, f: open3d.io.write_point_cloud(
        str(p), _open3d_cloud(v, attributes=True)
    ),
    ("Open3D", "pts", "default"): lambda p, v, f: open3d.io.write_point_cloud(
        str(p), _open3d_cloud(v), write_ascii=True
    ),
    ("trimesh", "ply", "points"): lambda p, v, f: trimesh.PointCloud(v).export(str(p)),
    ("trimesh", "xyz", "points"): lambda p, v, f: trimesh.PointCloud(v).export(str(p)),
    ("pymeshlab", "ply", "points"): lambda p, v, f: _meshlab(v).save_current_mesh(str(p)),
    ("pymeshlab", "xyz", "points"): lambda p, v, f: _meshlab(v).save_current_mesh(str(p)),
    ("pymeshlab", "obj", "points"): lambda p, v, f: _meshlab(v).save_current_mesh(str(p)),
    ("pymeshlab", "off", "points"): lambda p, v, f: _meshlab(v).save_current_mesh(str(p)),
    ("numpy", "txt", "spaces"): _text(" "),
    ("numpy", "csv", "heading"): _text(",", header="x,y,z"),
    ("numpy", "txt", "decimal commas, semicolons"): _text(";", comma=True),
}
