"""A glTF is read with its buffers beside it in a zip archive, and with meshes that Draco compressed."""

import io
import json
import zipfile
from collections.abc import Mapping
from importlib import util
from typing import Any

import DracoPy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import extras
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.gltf import read_glb
from tests.pipeline.stages.load.test_gltf_reader import CORNERS, HALVES, Maker
from tests.support import shapes

BALL = shapes.icosphere(10.0, 2)
SQUARE = CORNERS[np.array(HALVES)]


def read(data: bytes, **limits: int) -> Contents:
    return read_glb(data, LoadSettings(**limits))


def zipped(files: Mapping[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return out.getvalue()


def outer(uri: str) -> tuple[bytes, bytes]:
    """The JSON of a square whose buffer is at `uri`, and the buffer."""
    made = Maker().square()
    made.json["buffers"][0] = {"byteLength": len(made.data), "uri": uri}
    return json.dumps(made.json).encode(), made.data


def corners(data: bytes) -> Any:
    vertices, faces = joined(read(data))
    return vertices[faces]


ARCHIVES = {
    "beside": zipped(dict(zip(("part.gltf", "part.bin"), outer("part.bin"), strict=True))),
    "buffer first": zipped(dict(zip(("part.bin", "part.gltf"), outer("part.bin")[::-1], strict=True))),
    "in a folder": zipped(dict(zip(("a/b/part.gltf", "a/b/part.bin"), outer("part.bin"), strict=True))),
    "in another folder": zipped(dict(zip(("a/x.gltf", "data/y.bin"), outer("../data/y.bin"), strict=True))),
    "percent-encoded": zipped(dict(zip(("x.gltf", "my part.bin"), outer("my%20part.bin"), strict=True))),
    "other case, Windows": zipped(dict(zip(("X.GLTF", "Data\\Y.BIN"), outer("data/y.bin"), strict=True))),
    "with textures and files of macOS": zipped(
        dict(zip(("part.gltf", "part.bin"), outer("part.bin"), strict=True))
        | {"wood.png": b"\x89PNG", "__MACOSX/._part.gltf": b"\0\5\x16\7"}
    ),
    "embedded buffers": zipped({"part.gltf": Maker().square().gltf()}),
    "a GLB": zipped({"part.glb": Maker().square().glb()}),
}


@pytest.mark.parametrize("name", ARCHIVES)
def test_an_archive_gives_the_square(name: str) -> None:
    data = ARCHIVES[name]
    assert detect_format(data[:4096], len(data), "upload.zip") == Format.GLB
    np.testing.assert_array_equal(corners(data), SQUARE)


@pytest.mark.parametrize(
    ("files", "reason"),
    [
        ({"part.gltf": outer("part.bin")[0]}, r"another file, 'part\.bin', which was not sent"),
        ({"a.gltf": b"{}", "b.gltf": b"{}"}, r"has 2 glTF files \(a\.gltf, b\.gltf\)"),
        ({"readme.txt": b""}, "the zip archive has no glTF"),
        ({"part.gltf": outer("../../../etc/passwd")[0]}, "which was not sent"),
        ({"part.gltf": outer("http://example.org/part.bin")[0]}, "which was not sent"),
        ({"part.gltf": outer("file:///etc/passwd")[0]}, "which was not sent"),
    ],
)
def test_what_is_missing_is_named_and_nothing_outside_is_opened(files: dict[str, bytes], reason: str) -> None:
    with pytest.raises(errors.UnreadableFile, match=reason):
        read(zipped(files))


def test_a_buffer_that_is_too_short_or_a_bomb_is_refused() -> None:
    text, data = outer("part.bin")
    with pytest.raises(errors.TruncatedFile, match="buffer 0"):
        read(zipped({"part.gltf": text, "part.bin": data[:-4]}))
    with pytest.raises(errors.MeshTooLarge, match="unpacks to"):
        read(zipped({"part.gltf": text, "part.bin": data + bytes(10**6)}), max_archive_expansion=10)
    with pytest.raises(errors.UnreadableFile, match="not a complete zip archive"):
        read(ARCHIVES["beside"][:-30])


def draco(compressed: bytes, number: int = 0, *, required: bool = True, **accessor: Any) -> Maker:
    """A primitive of Draco; its accessors have no bytes."""
    made = Maker()
    count, n_corners = len(BALL.vertices), 3 * len(BALL.faces)
    made.json["accessors"] = [
        {"componentType": 5126, "count": count, "type": "VEC3"} | accessor,
        {"componentType": 5125, "count": n_corners, "type": "SCALAR"},
    ]
    extension = {"bufferView": made.view(compressed), "attributes": {"POSITION": number}}
    made.primitive(0, 1, extensions={"KHR_draco_mesh_compression": extension})
    made.json["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    made.json["extensionsRequired"] = ["KHR_draco_mesh_compression"] * required
    return made


def encoded(points: Any = BALL.vertices, **options: Any) -> bytes:
    made: bytes = DracoPy.encode(
        np.asarray(points), BALL.faces.astype(np.uint32), preserve_order=True, **options
    )
    return made


@pytest.mark.parametrize("required", [True, False])
@pytest.mark.parametrize("level", [0, 5, 10])
def test_draco_gives_the_mesh_within_its_quantization(level: int, required: bool) -> None:
    bits = 16
    data = draco(
        encoded(BALL.vertices.astype(np.float32), quantization_bits=bits, compression_level=level),
        required=required,
    ).glb()
    vertices, faces = joined(read(data))
    expected = BALL.vertices[BALL.faces]
    step = float(np.ptp(BALL.vertices, axis=0).max()) / (2**bits - 1)
    found = vertices[faces]
    assert len(found) == len(expected)
    order, other = (np.lexsort(each.mean(axis=1).round(2).T) for each in (found, expected))
    np.testing.assert_allclose(found.mean(axis=1)[order], expected.mean(axis=1)[other], atol=2 * step + 0.01)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    x, y, z = (expected[:, k] for k in range(3))
    assert volume == pytest.approx(np.einsum("ij,ij->", x, np.cross(y, z)) / 6, rel=1e-4)


def test_the_transform_of_the_node_applies_to_draco_as_well() -> None:
    data = draco(encoded(BALL.vertices.astype(np.float32), quantization_bits=16)).node(scale=[2, 2, 2]).glb()
    vertices, _ = joined(read(data))
    assert np.linalg.norm(vertices, axis=1).max() == pytest.approx(20.0, rel=1e-3)


def test_damaged_draco_is_refused() -> None:
    good = encoded(BALL.vertices.astype(np.float32), quantization_bits=14)
    for data in (b"DRACO", good[: len(good) // 2], b""):
        with pytest.raises(errors.UnreadableFile, match="cannot be decompressed"):
            read(draco(data).glb())
    with pytest.raises(errors.UnreadableFile, match="no attribute 7 with positions"):
        read(draco(good, number=7).glb())
    with pytest.raises(errors.MeshTooLarge):
        read(draco(good).glb(), max_faces=10)


def test_without_the_package_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extras, "find_spec", lambda name: None if name == "DracoPy" else util.find_spec(name))
    with pytest.raises(errors.UnreadableFile, match=r"KHR_draco_mesh_compression\), this") as refused:
        read(draco(encoded()).glb())
    assert "`pip install DracoPy` (the extra `draco`" in refused.value.remedy


BROKEN = [ARCHIVES["beside"], draco(encoded(BALL.vertices.astype(np.float32), quantization_bits=11)).glb()]


@given(
    st.sampled_from(BROKEN),
    st.integers(0, 6000),
    st.sampled_from([b"", b"\xff" * 4, b"\0", b"\x01", b"PK"]),
    st.integers(0, 8),
)
def test_a_changed_file_is_read_or_refused(whole: bytes, at: int, evil: bytes, lost: int) -> None:
    try:
        joined(read(whole[:at] + evil + whole[at + lost :]))
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
