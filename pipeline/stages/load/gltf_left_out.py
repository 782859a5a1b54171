"""What of a glTF is not part of the mesh, as notes."""

from dataclasses import dataclass, field

from pipeline.core.formats import Format
from pipeline.core.results import Note

#: Names in a message, and characters of one.
MAX_NAMES, MAX_CHARACTERS = 5, 40


@dataclass(frozen=True, slots=True)
class Reason:
    """code : of the note; one, many : what it is, after its number; effect : what that does to the result"""

    one: str
    many: str
    effect: str
    code: str


LINES = Reason(
    "primitive of lines", "primitives of lines", "left out: lines have no area", code="left_out_of_gltf"
)
CLOUDS = Reason(
    "primitive of points",
    "primitives of points",
    "left out: only the triangles are read",
    code="left_out_of_gltf",
)
EMPTY = Reason(
    "primitive without positions",
    "primitives without positions",
    "left out: it has nothing to place",
    code="left_out_of_gltf",
)
REMAINDER = Reason(
    "primitive that ends within a triangle",
    "primitives that end within a triangle",
    "read up to the last whole triangle: the file may be incomplete",
    code="left_out_of_gltf",
)
ELSEWHERE = Reason(
    "node with a mesh outside of the default scene",
    "nodes with meshes outside of the default scene",
    "left out; if it belongs to the part, export it in the same scene",
    code="left_out_of_gltf",
)
HIDDEN = Reason(
    "hidden node with its children",
    "hidden nodes with their children",
    "left out; to use it, make it visible",
    code="left_out_of_gltf",
)
MORPHS = Reason(
    "mesh with morph targets",
    "meshes with morph targets",
    "read as stored, before any morph: where the file shows it morphed, the shape differs",
    code="morph_ignored",
)
SKINS = Reason(
    "node with a skin but without joints for its vertices",
    "nodes with skins but without joints for their vertices",
    "read in the pose that is stored, at the place of the node",
    code="skin_ignored",
)


@dataclass(slots=True)
class LeftOut:
    """What was left out, by reason, in the order in which it was met."""

    found: dict[Reason, list[str]] = field(default_factory=dict)

    def add(self, reason: Reason, name: str) -> None:
        self.found.setdefault(reason, []).append(name)

    def notes(self) -> tuple[Note, ...]:
        """One for each reason, with number and names."""
        return tuple(
            Note(
                code=reason.code,
                detail=f"the {Format.GLB}: {self.phrase(reason)} {'was' if len(names) == 1 else 'were'} "
                f"{reason.effect}",
            )
            for reason, names in self.found.items()
        )

    def phrase(self, reason: Reason) -> str:
        """`2 primitives of lines (axes, frame)`."""
        names = self.found[reason]
        known = [_shown(name) for name in dict.fromkeys(names) if name]
        more = [f"and {len(known) - MAX_NAMES} more"] if len(known) > MAX_NAMES else []
        listed = f" ({', '.join(known[:MAX_NAMES] + more)})" if known else ""
        return f"{len(names)} {reason.one if len(names) == 1 else reason.many}{listed}"


def _shown(name: str) -> str:
    clean = "".join(letter if letter.isprintable() else " " for letter in name[: 2 * MAX_CHARACTERS]).strip()
    return clean if len(clean) <= MAX_CHARACTERS else clean[: MAX_CHARACTERS - 1] + "…"
