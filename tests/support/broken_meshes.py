"""Real mesh files of every format, bytes of which are changed, cut, doubled or replaced by numbers that break
programs.
"""

import io
import random
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import laspy
import pye57
import trimesh

from pipeline.core.mesh import FloatArray
from tests.support import step_files
from tests.support.shapes import icosphere
from tests.support.vtp_files import Layout

FORMATS = ("stl", "stl_ascii", "ply", "ply_ascii", "obj", "off", "3mf", "glb", "xyz")
FORMATS += ("amf", "vtp", "vtp_ascii", "step", "las", "laz", "e57")
#: Those of points, which are for scans only.
CLOUDS = ("xyz", "las", "laz", "e57")
EVIL_WORDS = [
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"1e999",
    b"-1",
    b"99999999999",
    b"4294967295",
    b"0",
    b"",
    b"\xff\xfe",
    b"1e-320",
]
EVIL_BYTES = [b"\x00" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\x00\x00\xc0\x7f", b"\x00\x00\x80\x7f"]


@cache
def sources() -> dict[str, bytes]:
    """A small closed mesh in each format."""
    shape = icosphere(10.0, 1)
    mesh = trimesh.Trimesh(shape.vertices * [1.0, 0.8, 0.6], shape.faces, process=False)
    made: dict[str, bytes] = {}
    for kind in FORMATS:
        name, _, is_ascii = kind.partition("_")
        if kind in ("las", "laz"):
            made[kind] = las(mesh.vertices, compressed=kind == "laz")
        elif kind == "e57":
            made[kind] = e57(mesh.vertices)
        elif kind == "step":
            made[kind] = step_files.cylinder(5.0, 20.0)
        elif kind == "amf":
            made[kind] = amf(mesh)
        elif name == "vtp":
            layout = Layout() if is_ascii else Layout("appended", compressor="vtkZLibDataCompressor")
            made[kind] = layout.file(layout.piece(mesh.vertices, Polys=mesh.faces.tolist()))
        elif kind == "xyz":
            made[kind] = "\n".join(" ".join(f"{x:.4f}" for x in point) for point in mesh.vertices).encode()
        elif name == "ply":
            made[kind] = trimesh.exchange.ply.export_ply(mesh, encoding="ascii" if is_ascii else "binary")
        else:
            content = mesh.export(file_type=kind)
            made[kind] = content.encode() if isinstance(content, str) else content
    return made


def las(points: FloatArray, *, compressed: bool) -> bytes:
    """A point cloud as LAS or LAZ."""
    header = laspy.LasHeader(version="1.4", point_format=7)
    header.scales = [0.001] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    out = io.BytesIO()
    cloud.write(out, do_compress=compressed)
    return out.getvalue()


def e57(points: FloatArray) -> bytes:
    """A point cloud as E57, of one scan."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.e57"
        with pye57.E57(str(path), "w") as file:
            columns = zip(("cartesianX", "cartesianY", "cartesianZ"), points.T.copy(), strict=True)
            file.write_scan_raw(dict(columns), translation=points[0])
        return path.read_bytes()


def amf(mesh: trimesh.Trimesh) -> bytes:
    """A mesh as AMF, in the least form."""
    vertices = "".join(
        f"<vertex><coordinates><x>{x:.6f}</x><y>{y:.6f}</y><z>{z:.6f}</z></coordinates></vertex>\n"
        for x, y, z in mesh.vertices
    )
    triangles = "".join(
        f"<triangle><v1>{a}</v1><v2>{b}</v2><v3>{c}</v3></triangle>\n" for a, b, c in mesh.faces
    )
    return (
        f'<?xml version="1.0"?>\n<amf unit="millimeter"><object id="0"><mesh>\n<vertices>{vertices}'
        f"</vertices>\n<volume>{triangles}</volume></mesh></object></amf>\n"
    ).encode()


def mutated(content: bytes, draw: random.Random) -> bytes:
    """One to four changes."""
    for _ in range(draw.randint(1, 4)):
        content = changed(content, draw) or b"\n"
    return content


def changed(content: bytes, draw: random.Random) -> bytes:
    """One change."""
    at, to = sorted((draw.randrange(len(content) + 1), draw.randrange(len(content) + 1)))
    to = min(to, at + 400)
    evil, word = draw.choice(EVIL_BYTES), draw.choice(EVIL_WORDS)
    match draw.randrange(9):
        case 0:
            return content[:at]
        case 1:
            return content[:at] + content[to:]
        case 2:
            return content[:to] + content[at:]
        case 3:
            return content[:at] + draw.randbytes(to - at) + content[to:]
        case 4:
            return content[:at] + evil + content[at + 4 :]
        case 5:  # in the header
            return content[: at % 200] + evil + content[at % 200 + 4 :]
        case 6:
            return b" ".join(word if draw.random() < 0.02 else each for each in content.split(b" "))
        case 7:
            return content.replace(str(draw.randrange(10)).encode(), word, 3)
        case _:
            return content.replace(b"\n", draw.choice([b"\r", b"\r\n", b" ", b"\n\n\n"]))


def cases(count: int) -> Iterator[tuple[str, bytes]]:
    """`count` broken meshes: the ending of a file and its content."""
    made = sources()
    for number in range(count):
        draw = random.Random(number)
        kind = FORMATS[number % len(FORMATS)]
        yield kind.partition("_")[0], mutated(made[kind], draw)
