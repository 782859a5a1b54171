"""3MF."""

import io
import zipfile

from pipeline.core.errors import MeshTooLarge, UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.by_trimesh import read_by_trimesh
from pipeline.stages.load.contents import Contents


def read_three_mf(data: bytes, settings: LoadSettings) -> Contents:
    """What a 3MF builds."""
    _check_unpacked_size(data, settings)
    return read_by_trimesh(data, Format.THREE_MF)


def _check_unpacked_size(data: bytes, settings: LoadSettings) -> None:
    """Raise MeshTooLarge for a zip bomb, before anything is unpacked."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
    except (zipfile.BadZipFile, OSError, ValueError) as error:
        raise UnreadableFile("the 3MF is not a complete zip archive") from error
    if unpacked > settings.max_archive_expansion * len(data):
        raise MeshTooLarge(
            f"the 3MF of {len(data)} bytes unpacks to {unpacked} bytes; "
            f"the limit is {settings.max_archive_expansion} times its size",
            remedy="if this is a real part, export it as binary STL",
        )
