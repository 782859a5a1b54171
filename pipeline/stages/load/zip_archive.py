"""Files in a zip archive, which may be damaged, encrypted or a bomb; and what kind of mesh it holds."""

import io
import lzma
import posixpath
import struct
import zipfile
import zlib
from urllib.parse import unquote

from pipeline.core.errors import MeshTooLarge, UnreadableFile
from pipeline.core.formats import ZIP, Format, format_of_entry
from pipeline.core.settings import LoadSettings

#: What zipfile raises for an entry that is damaged.
DAMAGE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, OSError, ValueError)
UNENCRYPTED = "save the part without encryption or password, or export it as binary STL"


class Archive:
    """Files by name. Names compare without case, leading slash and percent-encoding, as in OPC.

    label : what messages call it

    Raises
    ------
    UnreadableFile
        When the data is not a complete zip archive.
    MeshTooLarge
        When it unpacks to more than `max_archive_expansion` times its size, before anything is unpacked.
    """

    def __init__(self, data: bytes, settings: LoadSettings, label: str) -> None:
        self.label = label
        try:
            self._archive = zipfile.ZipFile(io.BytesIO(data))
        except (zipfile.BadZipFile, OSError, ValueError, NotImplementedError, struct.error) as error:
            raise UnreadableFile(f"the {label} is not a complete zip archive") from error
        # not is_dir(): it fails for an empty name
        entries = [entry for entry in self._archive.infolist() if not entry.filename.endswith("/")]
        unpacked = sum(entry.file_size for entry in entries)
        if unpacked > settings.max_archive_expansion * len(data):
            raise MeshTooLarge(
                f"the {label} of {len(data)} bytes unpacks to {unpacked} bytes; "
                f"the limit is {settings.max_archive_expansion} times its size",
                remedy="if this is a real part, export it as binary STL",
            )
        self._entries = {_key(entry.filename): entry for entry in entries}

    @property
    def names(self) -> list[str]:
        """Names of the files, in the order of the archive, without leading slash."""
        return [entry.filename.replace("\\", "/").lstrip("/") for entry in self._entries.values()]

    def part(self, target: str, base: str = "") -> str | None:
        """The name of the file that `target` refers to from file `base`; None when there is none."""
        for name in (target, posixpath.join("/", posixpath.dirname(base), target)):
            entry = self._entries.get(_key(posixpath.normpath(name)))
            if entry is not None:
                return entry.filename.replace("\\", "/").lstrip("/")
        return None

    def read(self, name: str) -> bytes:
        """The content of a file.

        Raises
        ------
        UnreadableFile
            When it is encrypted or damaged.
        """
        entry = self._entries[_key(name)]
        where = f"{name} in the {self.label}"
        if entry.flag_bits & 1:
            raise UnreadableFile(f"{where} is protected with a password", remedy=UNENCRYPTED)
        try:
            return self._archive.read(entry)
        except DAMAGE as error:
            raise UnreadableFile(f"{where} is damaged: its zip entry cannot be unpacked") from error
        except (NotImplementedError, RuntimeError) as error:
            raise UnreadableFile(f"{where} is packed by a method that cannot be read ({error})") from error


def format_of_archive(data: bytes, otherwise: Format) -> Format:
    """The format of the files in a zip archive; `otherwise` where `data` is none, or it cannot be told."""
    if not data.startswith(ZIP):
        return otherwise
    try:
        names = zipfile.ZipFile(io.BytesIO(data)).namelist()
    except (*DAMAGE, NotImplementedError):
        return otherwise
    found = {format_of_entry(name) for name in names if not name.startswith("__MACOSX/")} - {None}
    for kind in (Format.THREE_MF, Format.AMF, Format.GLB):
        if kind in found:
            return kind
    return otherwise


def _key(name: str) -> str:
    return unquote(name.replace("\\", "/")).lstrip("/").lower()
