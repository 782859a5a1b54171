"""The parts of a file, and the one that is the design: items of a 3MF, objects of an OBJ, STL solids."""

import re
from dataclasses import replace

from pipeline.core.errors import PartNotFound
from pipeline.core.results import Note
from pipeline.stages.load.contents import Contents, FilePart, used_bodies

#: Parts named in a message, and characters of one name. Chosen by hand.
MAX_PARTS, MAX_CHARACTERS = 12, 40


def choose_part(contents: Contents, wanted: str | None, *, is_design: bool = True) -> Contents:
    """The bodies of the parts that `wanted` names; all of them for None and `all`, with a note that lists
    them where there are several.

    wanted : a name, a number from 1, several numbers (`1,3`), or `all`. A name counts before a number. Where
        the file has one part, it names one of its components; is_design : options.design_part applies to it

    Raises
    ------
    PartNotFound
        With the names and numbers of all parts.
    """
    names, owner = _parts(contents)
    if len(names) < 2 and wanted in (None, "all"):
        return contents
    if len(names) < 2 and len(owner) > 1:  # one item of several components
        names, owner = [body.name for body in used_bodies(contents)], list(range(len(owner)))
    if wanted is None or wanted == "all":
        detail = f"the file has {len(names)} parts ({_listed(names)}), and all of them are read as one"
        if is_design:
            detail += "; options.design_part reads one of them"
        notes = [note for note in contents.notes if note.code != "several_parts"]
        return replace(contents, notes=(*notes, Note(code="several_parts", detail=detail)))
    chosen = _chosen(names, wanted)
    bodies = tuple(body for body, part in zip(used_bodies(contents), owner, strict=True) if part in chosen)
    detail = (
        f"the file has {len(names)} parts; {_listed([names[at] for at in chosen], chosen)} "
        f"{'is' if len(chosen) == 1 else 'are'} read (options.design_part), the others are left out"
    )
    notes = [note for note in contents.notes if note.code != "several_parts"]
    return replace(contents, bodies=bodies, notes=(*notes, Note(code="design_part", detail=detail)))


def _parts(contents: Contents) -> tuple[list[str], list[int]]:
    """Names of the parts, and the part of each body that is used."""
    bodies = used_bodies(contents)
    parts = [body.part or FilePart(at, body.name) for at, body in enumerate(bodies)]
    place = {part: at for at, part in enumerate(dict.fromkeys(parts))}
    return [part.name for part in place], [place[part] for part in parts]


def _chosen(names: list[str], wanted: str) -> list[int]:
    """Parts from 0, ascending."""
    for same in (str, str.casefold):
        found = [at for at, name in enumerate(names) if name and same(name.strip()) == same(wanted.strip())]
        if len(found) == 1:
            return found
        if found:
            raise PartNotFound(
                f"{len(found)} parts are named {wanted!r}: {_listed([names[at] for at in found], found)}",
                remedy="send the number of one of them in options.design_part",
            )
    words = re.split(r"[\s,]+", wanted.strip())
    if all(re.fullmatch(r"\d{1,9}", word) and 1 <= int(word) <= len(names) for word in words):
        return sorted({int(word) - 1 for word in words})
    raise PartNotFound(f"there is no part {wanted!r}; the file has {len(names)}: {_listed(names)}")


def _listed(names: list[str], places: list[int] | None = None) -> str:
    """Numbers and names: `1 bracket, 2 cover`."""
    places = list(range(len(names))) if places is None else places
    pairs = zip(places[:MAX_PARTS], names[:MAX_PARTS], strict=True)
    shown = [f"{at + 1} {_shown(name)}".strip() for at, name in pairs]
    more = [f"and {len(names) - MAX_PARTS} more"] if len(names) > MAX_PARTS else []
    return ", ".join(shown + more)


def _shown(name: str) -> str:
    clean = "".join(letter if letter.isprintable() else " " for letter in name).strip()
    return clean if len(clean) <= MAX_CHARACTERS else clean[: MAX_CHARACTERS - 1] + "…"
