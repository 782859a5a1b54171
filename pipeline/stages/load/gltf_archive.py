"""A glTF and the files that it refers to, in one zip archive."""

from urllib.parse import unquote

from pipeline.core.errors import UnreadableFile
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.gltf_container import Container, open_container
from pipeline.stages.load.three_mf_left_out import listed
from pipeline.stages.load.zip_archive import Archive


def open_archive(data: bytes, settings: LoadSettings) -> Container:
    """The one glTF of the archive; its buffers are files of the archive, by their names relative to it.

    Raises
    ------
    UnreadableFile, TruncatedFile, MeshTooLarge
        When the archive is damaged, or has no glTF or several.
    """
    archive = Archive(data, settings, "zip archive")
    own = [name for name in archive.names if not name.startswith("__MACOSX/")]
    found = [name for name in own if name.lower().endswith(".gltf")]
    found = found or [name for name in own if name.lower().endswith(".glb")]
    if len(found) != 1:
        raise UnreadableFile(
            f"the zip archive has {len(found)} glTF files ({listed(found)})"
            if found
            else "the zip archive has no glTF",
            remedy="send one .gltf with its files in the archive, or one GLB",
        )

    def outside(uri: str) -> bytes | None:
        name = archive.part(unquote(uri), found[0])
        return None if name is None else archive.read(name)

    container = open_container(archive.read(found[0]))
    container.outside = outside
    return container
