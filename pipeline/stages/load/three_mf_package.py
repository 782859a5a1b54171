"""The parts of a 3MF package: an OPC container in a zip archive (ECMA-376 part 2; 3MF core specification,
chapters 1 and 2).
"""

from lxml import etree  # type: ignore[import-untyped]

from pipeline.core.errors import UnreadableFile
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.three_mf_xml import OPTIONS, not_well_formed
from pipeline.stages.load.zip_archive import UNENCRYPTED, Archive

#: Type of the relationship to the root model (core specification, appendix C).
MODEL_RELATION = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
#: What an encrypted part starts with (Secure Content extension, section 2.2).
ENCRYPTED_HEAD = b"%3McF"


class Package(Archive):
    """Parts by name, as `Archive` has them.

    Raises
    ------
    UnreadableFile
        When the data is not a complete zip archive.
    MeshTooLarge
        When it unpacks to more than `max_archive_expansion` times its size, before anything is unpacked.
    """

    def __init__(self, data: bytes, settings: LoadSettings) -> None:
        super().__init__(data, settings, "3MF")

    def read(self, name: str) -> bytes:
        """The content of a part.

        Raises
        ------
        UnreadableFile
            When it is encrypted or damaged.
        """
        data = super().read(name)
        if data.startswith(ENCRYPTED_HEAD):
            raise UnreadableFile(
                f"{name} in the 3MF is encrypted (Secure Content extension)", remedy=UNENCRYPTED
            )
        return data

    def root_model(self) -> str:
        """The name of the model part that the package starts from: the target of the 3dmodel relationship of
        `_rels/.rels`, or else the only model part, or `3D/3dmodel.model`.

        Raises
        ------
        UnreadableFile
            When the package has no such part.
        """
        targets = self._model_targets()
        for target in targets:
            name = self.part(target)
            if name is not None:
                return name
        models = [name for name in self.names if name.lower().endswith(".model")]
        for name in models:
            if len(models) == 1 or name.lower() == "3d/3dmodel.model":
                return name
        self.refuse_gcode()
        if targets:
            raise UnreadableFile(
                f"the 3MF has no part {targets[0]}, which its _rels/.rels names as the model"
            )
        raise UnreadableFile(
            "the zip archive is not a 3MF: it has no model part (_rels/.rels names none)",
            remedy="send the mesh file itself (see docs/formats.md)",
        )

    def refuse_gcode(self) -> None:
        """Raise UnreadableFile when the package has G-code, for a caller who found no mesh."""
        sliced = sorted(name for name in self.names if name.lower().endswith((".gcode", ".bgcode")))
        if sliced:
            raise UnreadableFile(
                f"the 3MF has G-code of a sliced plate ({sliced[0]}) and no mesh",
                remedy="export the model or the project from the slicer, not the sliced plate",
            )

    def _model_targets(self) -> list[str]:
        rels = self.part("_rels/.rels")
        if rels is None:
            return []
        data = self.read(rels)
        try:
            root = etree.fromstring(data, etree.XMLParser(**OPTIONS))
        except etree.XMLSyntaxError as error:
            raise not_well_formed(rels, data, error) from error
        relations = [each for each in root.iter("{*}Relationship") if each.get("Target")]
        typed = [each for each in relations if each.get("Type") == MODEL_RELATION]
        return [str(each.get("Target")) for each in typed]
