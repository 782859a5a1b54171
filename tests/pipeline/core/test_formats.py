"""A look at an upload: what it is, and that no upload makes it long. The API does it with the GIL held."""

import subprocess
import sys

import pytest

from pipeline import Format, detect_format
from pipeline.core.errors import PipelineError

#: What a head is made of again and again, and what ends it so that nothing fits.
HOSTILE = {
    "digits": (b"1", b"x"),
    "digits in words": (b"1111111111 ", b"x"),
    "signs": (b"+", b"1"),
    "points": (b".1", b"x"),
    "exponents": (b"1e1", b"x"),
    "separators": (b" ,;", b"x"),
    "spaces after numbers": (b"1 2 3" + b" " * 100, b"x"),
    "line ends": (b"x" + b"\n" * 50, b"x"),
    "blank lines": (b"\n", b"x"),
    "line feeds and spaces": (b"\n ", b"x"),
    "carriage returns": (b"\r", b"x"),
    "almost a vertex": (b"v  ", b""),
    "almost a vertex a line": (b"v \n", b""),
    "headings": (b"x\n", b"1 2 3"),
    "words of nan": (b"nan", b"x"),
    "infinities": (b"-infinity ", b"x"),
    "OFF": (b"STCN4n", b"OF"),
    "solid": (b"solid ", b""),
    "comments": (b"#\n", b"x"),
    "comments of G-code": (b";a\n", b"x"),
    "lines of G-code": (b"G1\n", b"x"),
    "an XML comment": (b"<!--", b"x"),
    "comments of a point cloud": (b"#.\n", b"x"),
    "empty entries of a ZIP": (b"PK\x03\x04" + bytes(26), b""),
    "slashes": (b"//\n", b"x"),
    "open comments of STEP": (b"/*", b"x"),
    "comments of STEP": (b"/**/", b"x"),
    "stars of STEP": (b"/***", b"x"),
    "zip entries": (b"PK\3\4", b"x"),
    "tags": (b"<", b"x"),
    "almost AMF": (b"<amf", b"x"),
}
LOOK = """
import sys, time
from pipeline import detect_format
from pipeline.core.errors import PipelineError
head = sys.stdin.buffer.read()
begun = time.perf_counter()
try:
    detect_format(head, 10**6, "points.xyz")
except PipelineError:
    pass
print(time.perf_counter() - begun)
"""


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_head_costs_time_in_proportion_to_its_length(kind: str) -> None:
    """Sixteen times what the API looks at, in a process that can be killed: `re` cannot be interrupted."""
    part, end = HOSTILE[kind]
    head = (part * (65536 // len(part) + 1))[: 65536 - len(end)] + end
    done = subprocess.run([sys.executable, "-c", LOOK], input=head, capture_output=True, timeout=30)
    assert done.returncode == 0, done.stderr.decode()
    assert float(done.stdout) < 1.0  # some milliseconds; by squares it would be minutes


@pytest.mark.parametrize(
    ("head", "known"),
    [
        (b"1 2 3\n", Format.XYZ),
        (b"1. -2.5e+3 .5\n", Format.XYZ),
        (b"1,2,3,nan\n4;5;6;inf\n", Format.XYZ),
        (b"x y z\n+1 2 3\n", Format.XYZ),
        (b"  v 1 2 3\n", Format.OBJ),
        (b"# by hand\n\n\tv 0 0 0\n", Format.OBJ),
        (b"mtllib a.mtl\n", Format.OBJ),
        (b"ISO-10303-21;\nHEADER;\n", Format.STEP),
        (b"/* a *//* b **/\n ISO-10303-21 ;", Format.STEP),
        (b"LASF\0\0", Format.LAS),
        (b"ASTM-E57\1\0", Format.E57),
        (b"<?xml version='1.0'?>\n<VTKFile type='PolyData'>", Format.VTP),
        (b"<VTKFile type='UnstructuredGrid'>", Format.VTP),  # the reader names what it is
        (b"<?xml version='1.0'?><!-- a -->\n<amf unit='inch'>", Format.AMF),
        (b"<AMF>", Format.AMF),
        (b"PK\3\4" + bytes(22) + b"\x05\0\0\0a.amfx", Format.AMF),
        (b"PK\3\4" + bytes(22) + b"\x06\0\0\0a.gltfx", Format.GLB),
        (b"PK\3\4" + bytes(22) + b"\x05\0\0\0a.pngx", Format.THREE_MF),
    ],
)
def test_texts_are_told_apart(head: bytes, known: Format) -> None:
    assert detect_format(head, len(head)) is known


@pytest.mark.parametrize(
    "head", [b"1 2\n", b"1..2 3 4\n", b"1e 2 3\n", b"v\n1\n", b"--1 2 3\n", b"<svg>", b"ISO-10303"]
)
def test_what_is_almost_a_format_is_none(head: bytes) -> None:
    with pytest.raises(PipelineError):
        detect_format(head, len(head))
