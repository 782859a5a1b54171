"""Real mesh files of every format, bytes of which are changed, cut, doubled or replaced by numbers that break
programs.
"""

import random
from collections.abc import Iterator

import trimesh

from tests.support.shapes import icosphere

FORMATS = ("stl", "stl_ascii", "ply", "ply_ascii", "obj", "off", "3mf", "glb", "xyz")
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


def sources() -> dict[str, bytes]:
    """A small closed mesh in each format."""
    shape = icosphere(10.0, 1)
    mesh = trimesh.Trimesh(shape.vertices * [1.0, 0.8, 0.6], shape.faces, process=False)
    made: dict[str, bytes] = {}
    for kind in FORMATS:
        name, _, is_ascii = kind.partition("_")
        if kind == "xyz":
            made[kind] = "\n".join(" ".join(f"{x:.4f}" for x in point) for point in mesh.vertices).encode()
        elif name == "ply":
            made[kind] = trimesh.exchange.ply.export_ply(mesh, encoding="ascii" if is_ascii else "binary")
        else:
            content = mesh.export(file_type=kind)
            made[kind] = content.encode() if isinstance(content, str) else content
    return made


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
