"""What of a 3MF is not part of the mesh, as notes."""

from dataclasses import dataclass, field

from pipeline.core.results import Note

#: Names in a message, and characters of one.
MAX_NAMES, MAX_CHARACTERS = 5, 40


@dataclass(frozen=True, slots=True)
class Reason:
    """one, many : what it is, after its number; fact : what that means, after `is` or `are`; whole : whether
    all of it is left out
    """

    one: str
    many: str
    fact: str = "not part of the print"
    whole: bool = True


def of_kind(kind: str) -> Reason:
    """Objects of another type than `model`."""
    return Reason(f"object of type {kind}", f"objects of type {kind}")


def of_role(role: str) -> Reason:
    """Meshes that a slicer uses for something else, by their role."""
    fact = "not subtracted from the part" if role == "negative volume" else "not part of the print"
    return Reason(role, f"{role}s", fact)


def of_geometry(geometry: str) -> Reason:
    """Geometry other than triangles."""
    fact = "read without it: only triangles are read"
    return Reason(f"object with {geometry}", f"objects with {geometry}", fact, whole=False)


NOT_PRINTABLE = Reason("build item marked as not printable", "build items marked as not printable")
EMPTY = Reason("build item without triangles", "build items without triangles", "empty")
NOT_BUILT = Reason("object that no build item uses", "objects that no build item uses")


@dataclass(slots=True)
class LeftOut:
    """What was left out, by reason, in the order in which it was met."""

    found: dict[Reason, list[tuple[str, int]]] = field(default_factory=dict)

    def add(self, reason: Reason, name: str, triangles: int) -> None:
        self.found.setdefault(reason, []).append((name, triangles))

    def phrases(self) -> list[str]:
        """For each reason: `2 objects of type support (a, b; 1200 triangles)`."""
        return [_phrase(reason, entries) for reason, entries in self.found.items()]

    def notes(self) -> tuple[Note, ...]:
        """One for each reason."""
        notes = []
        for reason, entries in self.found.items():
            verb, past = ("is", "was") if len(entries) == 1 else ("are", "were")
            end = f" and {past} left out" if reason.whole else ""
            detail = f"the 3MF: {_phrase(reason, entries)} {verb} {reason.fact}{end}"
            notes.append(Note(code="left_out_of_3mf", detail=detail))
        return tuple(notes)


def listed(names: list[str]) -> str:
    """The first names, and how many more there are."""
    shown = [_shown(name) for name in names[:MAX_NAMES]]
    more = [f"and {len(names) - MAX_NAMES} more"] if len(names) > MAX_NAMES else []
    return ", ".join(shown + more)


def _phrase(reason: Reason, entries: list[tuple[str, int]]) -> str:
    names = listed([name for name, _ in entries])
    triangles = sum(count for _, count in entries)
    figure = f"; {triangles} {'triangle' if triangles == 1 else 'triangles'}" if triangles else ""
    return f"{len(entries)} {reason.one if len(entries) == 1 else reason.many} ({names}{figure})"


def _shown(name: str) -> str:
    clean = "".join(letter if letter.isprintable() else " " for letter in name).strip()
    return clean if len(clean) <= MAX_CHARACTERS else clean[: MAX_CHARACTERS - 1] + "…"
