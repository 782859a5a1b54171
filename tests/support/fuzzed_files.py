"""Small valid files of each dialect, and changes of them that keep the outer form: the parts of a 3MF are
packed again and the chunks of a GLB measured again, so that changes reach the reader behind the container.
"""

import base64
import io
import json
import random
import struct
import zipfile

import numpy as np

from tests.support.broken_meshes import EVIL_WORDS, mutated, sources
from tests.support.shapes import icosphere

#: Changes of structure that bytes alone seldom give.
COUNTS = [b"0", b"1", b"-1", b"2147483648", b"4294967295", b"18446744073709551616", b"1e9", b"0x7f"]


def seeds() -> dict[str, list[bytes]]:
    """Valid files, by the ending of the format."""
    made = sources()
    ball = icosphere(10.0, 1)
    rows = "".join(f"{x:.4f} {y:.4f} {z:.4f}\n" for x, y, z in ball.vertices)
    return {
        "stl": [made["stl"], made["stl_ascii"], made["stl"] * 2, made["stl"] + b"\1" * 150],
        "ply": [made["ply"], made["ply_ascii"], *_plys()],
        "obj": [made["obj"], _obj()],
        "off": [
            made["off"],
            _binary_off(),
            b"4nCOFF 2\n" + made["off"],
            b"OFF BINARY\n\0\0\0\4\0\0\0\2\0\0\0\0",
        ],
        "3mf": [made["3mf"], _three_mf()],
        "glb": [made["glb"], _gltf()],
        "xyz": [
            made["xyz"],
            rows.replace(" ", ";").replace(".", ",").encode(),
            ("//X Y Z R G B\n4\n" + "1.5 2.5 3.5 0 0 0\n" * 4).encode(),
            b"Point ID,X[mm],Y[mm],Z[mm]\r\n" + b"".join(b"%d,1.5,%d.25,3.5\r\n" % (i, i) for i in range(9)),
            b"2\n3\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n5 0 0 1\n"
            + b"1.5 2.5 3.5 0.5\n" * 6,
            "\ufeff".encode("utf-16-le") + rows.encode("utf-16-le"),
        ],
    }


def fuzzed(kind: str, draw: random.Random, files: list[bytes]) -> bytes:
    """One changed file of a format."""
    content = draw.choice(files)
    if kind == "3mf" and draw.random() < 0.8:
        return _in_package(content, draw)
    if kind == "glb" and content.startswith(b"glTF") and draw.random() < 0.8:
        return _in_chunks(content, draw)
    return _change(content, draw)


def _change(content: bytes, draw: random.Random) -> bytes:
    if draw.random() < 0.3:  # one number of the text, or of the first lines of a binary file
        words = content.split(b" ")
        at = draw.randrange(min(len(words), 60 if draw.random() < 0.5 else len(words)))
        words[at] = draw.choice(COUNTS + EVIL_WORDS) + (b"\n" if b"\n" in words[at] else b"")
        return b" ".join(words)
    return mutated(content, draw)


def _in_package(content: bytes, draw: random.Random) -> bytes:
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as parts, zipfile.ZipFile(packed, "w") as new:
        chosen = draw.choice(parts.namelist())
        for name in parts.namelist():
            part = parts.read(name)
            if name == chosen:
                part = _xml_change(part, draw) if draw.random() < 0.6 else _change(part, draw)
            new.writestr(name, part)
    return packed.getvalue()


def _xml_change(part: bytes, draw: random.Random) -> bytes:
    """The value of one attribute, or one element left out or doubled."""
    pieces = part.split(b'"') if draw.random() < 0.6 else part.split(b">")
    if len(pieces) < 4:
        return _change(part, draw)
    at = draw.randrange(1, len(pieces) - 1)
    mark = b'"' if part.count(b'"') + 1 == len(pieces) else b">"
    if mark == b'"':
        pieces[at] = draw.choice(COUNTS + EVIL_WORDS + [draw.choice(pieces)])
    elif draw.random() < 0.5:
        del pieces[at]
    else:
        pieces.insert(at, pieces[at])
    return mark.join(pieces)


def _in_chunks(content: bytes, draw: random.Random) -> bytes:
    length = struct.unpack_from("<I", content, 12)[0]
    text, rest = content[20 : 20 + length], content[20 + length :]
    if draw.random() < 0.7:
        text = _json_change(text, draw)
    else:
        rest = rest[:8] + mutated(rest[8:], draw)
    text += b" " * (-len(text) % 4)
    size = 20 + len(text) + len(rest)
    return b"glTF" + struct.pack("<II", 2, size) + struct.pack("<I", len(text)) + b"JSON" + text + rest


def _json_change(text: bytes, draw: random.Random) -> bytes:
    """One value of the document replaced by another of any type."""
    document = json.loads(text)
    places: list[tuple[dict[str, object] | list[object], str | int]] = []

    def walk(value: object) -> None:
        if isinstance(value, dict):
            for key, inner in value.items():
                places.append((value, key))
                walk(inner)
        elif isinstance(value, list):
            for at, inner in enumerate(value):
                places.append((value, at))
                walk(inner)

    walk(document)
    holder, key = draw.choice(places)
    others: list[object] = [
        0,
        1,
        -1,
        2**31,
        2**63,
        1e308,
        0.5,
        "",
        "x",
        None,
        True,
        [],
        {},
        [0, 0],
        5126,
        5121,
    ]
    holder[key] = draw.choice(others)  # type: ignore[index]
    return json.dumps(document).encode()


def _plys() -> list[bytes]:
    point = struct.pack
    head = "ply\nformat binary_{}_endian 1.0\nelement vertex 4\nproperty double x\nproperty float y\n"
    head += "property short z\n"
    faces = "element face 2\nproperty uchar flags\nproperty list uchar int vertex_indices\nend_header\n"
    made = []
    for name, mark in (("little", "<"), ("big", ">")):
        body = b"".join(point(f"{mark}dfh", *each) for each in [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 1)])
        body += point(f"{mark}BB4i", 7, 4, 0, 1, 2, 3) + point(f"{mark}BB3i", 7, 3, 0, 1, 2)
        made.append((head.format(name) + faces).encode() + body)
    strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    body = b"".join(point("<dfh", *each) for each in [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 1)])
    made.append((head.format("little") + strips).encode() + body + point("<i5i", 5, 0, 1, 2, -1, 3))
    grid = (
        "ply\nformat ascii 1.0\nobj_info num_cols 2\nobj_info num_rows 2\nelement vertex 4\n"
        "property float x\nproperty float y\nproperty float z\nelement range_grid 4\n"
        "property list uchar int vertex_indices\n"
        "end_header\n0 0 0.5\n1 0 0\n0 1 0\n1 1 nan\n1 0\n1 1\n1 2\n0\n"
    )
    return [*made, grid.encode()]


def _obj() -> bytes:
    lines = [
        "mtllib a.mtl",
        "o first",
        "v 0 0 0 1 0 0",
        "v 1 0 0",
        "v 1 1 0",
        "v 0 1 0",
        "vn 0 0 1",
        "vt 0 0",
    ]
    lines += ["f -4/1/1 -3//1 -2 -1", "g second", "v 0 0 5", "v 1 0 5", "v 0 1 5", "f 5 6 \\", "7", "l 1 2"]
    return "\n".join([*lines, "usemtl x", "s off", "p 1", ""]).encode()


def _binary_off() -> bytes:
    body = struct.pack(">3i", 4, 2, 0) + struct.pack(">12f", 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 1)
    body += struct.pack(">4ii", 3, 0, 1, 2, 0) + struct.pack(">4ii3f", 3, 0, 2, 3, 3, 0.5, 0.5, 0.5)
    return b"OFF BINARY\n" + body


def _three_mf() -> bytes:
    """Two parts, components with transforms, an object of type support, and a modifier of a slicer."""
    core = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    production = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06"
    mesh = (
        '<mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>'
        '<vertex x="0" y="0" z="1"/></vertices><triangles><triangle v1="0" v2="2" v3="1"/>'
        '<triangle v1="0" v2="1" v3="3"/><triangle v1="1" v2="2" v3="3"/><triangle v1="0" v2="3" v3="2"/>'
        "</triangles></mesh>"
    )
    root = (
        f'<model unit="millimeter" xmlns="{core}" xmlns:p="{production}" requiredextensions="p"><resources>'
        f'<object id="1" type="support">{mesh}</object><object id="2"><components>'
        '<component p:path="/3D/o.model" objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>'
        '<component p:path="/3D/o.model" objectid="3"/></components></object></resources><build>'
        '<item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 9"/><item objectid="1"/></build></model>'
    )
    other = (
        f'<model unit="inch" xmlns="{core}"><resources><object id="1">{mesh}</object>'
        f'<object id="3" name="b">{mesh}</object></resources><build/></model>'
    )
    relations = (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"><Relationship '
        'Target="/3D/3dmodel.model" Id="r" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/>'
        "</Relationships>"
    )
    settings = (
        '<config><object id="2"><part id="1" subtype="modifier_part"/>'
        '<part id="3" subtype="normal_part"/></object></config>'
    )
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as parts:
        parts.writestr("_rels/.rels", relations)
        parts.writestr("3D/3dmodel.model", root)
        parts.writestr("3D/o.model", other)
        parts.writestr("Metadata/model_settings.config", settings)
    return packed.getvalue()


def _gltf() -> bytes:
    """As JSON with its buffer within: a strided, sparse and normalised accessor, two nodes, a strip."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]], dtype="<f4")
    short = (corners * 32767).astype("<i2")
    buffer = corners.tobytes() + short.tobytes() + np.array([0, 1, 2, 3], dtype="<u2").tobytes()
    buffer += np.array([3], dtype="<u2").tobytes() + b"\0\0" + np.array([9, 9, 9], dtype="<f4").tobytes()
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    views = [(0, 48), (48, 24), (72, 8), (80, 2), (84, 12)]
    sparse = {
        "count": 1,
        "indices": {"bufferView": 3, "componentType": 5123},
        "values": {"bufferView": 4},
    }
    document = {
        "asset": {"version": "2.0"},
        "extensionsUsed": ["KHR_mesh_quantization"],
        "buffers": [{"uri": uri, "byteLength": len(buffer)}],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in views],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse},
            {"bufferView": 1, "componentType": 5122, "normalized": True, "count": 4, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5123, "count": 4, "type": "SCALAR"},
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0}, "indices": 2, "mode": 5}]},
            {"primitives": [{"attributes": {"POSITION": 1}, "indices": 2, "mode": 6}]},
        ],
        "nodes": [
            {"mesh": 0, "children": [1], "translation": [1, 2, 3], "rotation": [0, 0, 0, 1]},
            {"mesh": 1, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 5, 6, 1]},
        ],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return json.dumps(document).encode()
