"""Extensions that a 3MF requires of its reader (core specification, section 2.3.1: `requiredextensions`)."""

from collections.abc import Mapping

from pipeline.core.errors import UnreadableFile

#: Namespaces, without version, of extensions that leave the triangles as they are, or that are read here.
HARMLESS = (
    "http://schemas.microsoft.com/3dmanufacturing/core/",
    "http://schemas.microsoft.com/3dmanufacturing/production/2015/",
    "http://schemas.microsoft.com/3dmanufacturing/material/",
    "http://schemas.microsoft.com/3dmanufacturing/trianglesets/",
    "http://schemas.slic3r.org/3mf/",
)
#: A word of the namespace of those that define geometry or hide it, and their name.
NAMES = {
    "beamlattice": "beam lattice",
    "slice": "slices",
    "boolean": "boolean operations",
    "volumetric": "volumetric design",
    "implicit": "implicit functions",
    "displacement": "displacement",
    "toolpath": "toolpaths",
    "securecontent": "Secure Content (encryption)",
    "alternatives": "alternative representations of the production extension",
}


def refuse_unread(part: str, required: str, namespaces: Mapping[str | None, str]) -> None:
    """Raise UnreadableFile for an extension that part requires and that is not read.

    required : value of `requiredextensions`, prefixes with space between; namespaces : of the prefixes
    """
    for prefix in required.split():
        namespace = namespaces.get(prefix, "")
        if namespace.startswith(HARMLESS):
            continue
        known = next((name for word, name in NAMES.items() if word in namespace.lower()), None)
        named = known or namespace or f"with prefix {prefix!r}"
        raise UnreadableFile(
            f"{part} in the 3MF requires the extension {named!s}, which is not read: "
            "its geometry would be incomplete",
            remedy="export the part as a plain triangle mesh (3MF without this extension, or binary STL)",
        )
