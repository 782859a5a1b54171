"""Extensions of glTF 2.0: which ones are read or say nothing about the shape, and what is refused.

Source: registry of extensions, https://github.com/KhronosGroup/glTF/tree/main/extensions.
"""

from pipeline.core.errors import UnreadableFile
from pipeline.core.formats import Format
from pipeline.stages.load.gltf_container import MESHOPT
from pipeline.stages.load.gltf_draco import DRACO
from pipeline.stages.load.gltf_records import Document

QUANTIZATION = "KHR_mesh_quantization"
INSTANCING = "EXT_mesh_gpu_instancing"
VISIBILITY = "KHR_node_visibility"
#: Read; those of meshopt only where the file also has the data uncompressed.
READ = frozenset((QUANTIZATION, INSTANCING, VISIBILITY, DRACO, *MESHOPT))
#: Appearance, cameras, metadata, behaviour: the positions are the same without them.
WITHOUT_SHAPE = frozenset(
    (
        "ADOBE_materials_thin_transparency",
        "CESIUM_primitive_outline",
        "EXT_feature_metadata",
        "EXT_instance_features",
        "EXT_mesh_features",
        "EXT_mesh_manifold",
        "EXT_structural_metadata",
        "FB_geometry_metadata",
        "KHR_animation_pointer",
        "KHR_techniques_webgl",
        "KHR_xmp",
        "KHR_xmp_json_ld",
        "MSFT_packing_normalRoughnessMetallic",
        "MSFT_packing_occlusionRoughnessMetallic",
        "MSFT_texture_dds",
        "VRM",
    )
)
PREFIXES_WITHOUT_SHAPE = (
    "EXT_lights_",
    "EXT_texture_",
    "KHR_audio",
    "KHR_lights_",
    "KHR_materials_",
    "KHR_texture_",
    "VRMC_",
)


def check_required(document: Document) -> None:
    """Refuse a file that cannot be read without an extension which is not read here.

    Raises
    ------
    UnreadableFile
        With its name and the remedy.
    """
    for name in document.extensionsRequired:
        if name not in READ | WITHOUT_SHAPE and not name.startswith(PREFIXES_WITHOUT_SHAPE):
            raise UnreadableFile(
                f"the {Format.GLB} requires the extension {name[:80]!r}, which is not read",
                remedy="export the part without this extension",
            )
