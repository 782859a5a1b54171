"""A mesh on disk, as callers name it: the one type that every layer and every caller shares."""

from dataclasses import dataclass
from pathlib import Path

from pipeline.core.settings import Unit


@dataclass(frozen=True, slots=True)
class MeshFile:
    """A mesh on disk.

    path : where its bytes are; unit : what its numbers mean, `auto` for what the file declares (else mm);
    filename : the user's name for it, which only helps to tell the format; part : name or number of the part
    to read, of a file with several, `all` or None for all of them; columns : of a point text, as
    `core.point_columns` has them, None where the text says it
    """

    path: Path
    unit: Unit = "auto"
    filename: str | None = None
    part: str | None = None
    columns: str | None = None

    @classmethod
    def of(cls, mesh: "MeshFile | Path | str") -> "MeshFile":
        """A path becomes a `MeshFile` of that name, in the unit that the file declares."""
        return mesh if isinstance(mesh, MeshFile) else cls(Path(mesh), filename=Path(mesh).name)
