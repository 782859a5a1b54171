"""STEP (ISO 10303-21: AP203, AP214, AP242): its solids and surfaces as triangles, in the unit of the file.

Open CASCADE reads and tessellates it (package `cascadio`), in a process of its own. It gives a GLB: metres,
in single precision. Tessellation starts from the edges, which faces share: triangles of a sound solid fit
exactly, and an open edge says that a face is missing. Each triangle keeps the
number of its face of the CAD model.
"""

from dataclasses import replace

import numpy as np

from pipeline.core.errors import UnreadableFile
from pipeline.core.formats import as_utf8
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.extras import require
from pipeline.stages.load.gltf import read_glb
from pipeline.stages.load.step_process import Tessellation
from pipeline.stages.load.step_solids import split_solids
from pipeline.stages.load.step_text import StepText, read_step_text
from pipeline.stages.load.three_mf_left_out import listed
from pipeline.stages.load.units import DECLARED

#: Max distance between surface and triangles, as a share of the diagonal of the part.
TESSELLATION_SHARE = 1e-4
#: Tolerance in mm of the first tessellation, which tells the diagonal: the angle alone limits its triangles.
COARSE_MM = 1e9
MM_PER_METRE = 1000.0
#: Share of a coordinate by which single precision rounds it, at most.
ROUNDING_SHARE = 2.0**-24


def read_step(data: bytes, settings: LoadSettings) -> Contents:
    """One body for each solid of each placed part, with its name.

    Notes: `several_parts`, `step_surfaces`, `step_open_solid`, `step_hidden`, `left_out_of_step`.

    Raises
    ------
    TruncatedFile, UnreadableFile, MeshTooLarge
    """
    require("step", "a STEP")
    data = as_utf8(data).lstrip()
    text = read_step_text(data)
    with Tessellation(data) as tessellation:
        coarse = _bodies(tessellation.glb(COARSE_MM), settings, text)
        tolerance_mm = TESSELLATION_SHARE * _diagonal_mm(coarse)
        if tolerance_mm == 0:
            raise UnreadableFile("the surfaces of the STEP have no extent")
        products = _bodies(tessellation.glb(tolerance_mm), settings, text)
        bodies = _solids(products, text)
        if len(products) == 1:  # those of several come in an order of their own
            bodies = _named_faces(bodies, text)
    _check_rounding(bodies, tolerance_mm)
    notes = [
        *_several(bodies, text),
        *_surfaces(text),
        *_open(bodies, text),
        *_elsewhere(text),
        *_hidden(text),
    ]
    mm_per_unit = DECLARED[text.unit][1] if text.unit else 1.0
    scale = MM_PER_METRE / mm_per_unit
    scaled = tuple(replace(body, vertices=body.vertices * scale, part=None) for body in bodies)
    return Contents(scaled, text.unit, tuple(notes))


def _bodies(glb: bytes, settings: LoadSettings, text: StepText) -> list[Body]:
    """In metres. An empty `glb` has none."""
    try:
        bodies = list(read_glb(glb, settings).bodies) if glb else []
    except UnreadableFile as error:
        if "no triangles and no points" not in error.reason:
            raise
        bodies = []
    if not bodies:
        raise _nothing(text)
    return bodies


def _solids(products: list[Body], text: StepText) -> list[Body]:
    """Each solid by itself, where its triangles are closed. Of the only product they have their own names."""
    if text.surfaces or text.solids < 2:
        return products
    split = [split_solids(product) for product in products]
    if len(split) == 1 and len(split[0]) == text.solids:
        names = zip(split[0], text.solid_names, strict=True)
        return [replace(solid, name=name or solid.name) for solid, name in names]
    return [
        replace(solid, name=f"{solid.name} {number}".strip()) if len(solids) > 1 else solid
        for solids in split
        for number, solid in enumerate(solids, start=1)
    ]


def _named_faces(solids: list[Body], text: StepText) -> list[Body]:
    """The same, their faces with the names in the file. Each solid lists its faces in the order of Open
    CASCADE; where some of them have no triangles, none is named.
    """
    if len(solids) != len(text.face_names):
        return solids
    named = []
    for solid, names in zip(solids, text.face_names, strict=True):
        brep = solid.brep
        if brep is not None and len(brep.faces) == len(names):
            pairs = zip(brep.faces, names, strict=True)
            brep = replace(brep, faces=tuple(replace(face, name=name) for face, name in pairs))
        named.append(replace(solid, brep=brep))
    return named


def _nothing(text: StepText) -> UnreadableFile:
    if text.external:
        return UnreadableFile(
            f"the STEP has no solids and no surfaces of its own: it refers to {text.external} other files",
            remedy="export the assembly as one STEP file, without references to others",
        )
    if text.solids or text.surfaces:
        return UnreadableFile(
            f"none of the {text.solids} solids and {text.surfaces} surface models of the STEP could be "
            "turned into triangles: their faces are damaged, or no product refers to them"
        )
    return UnreadableFile(
        "the STEP has no solids and no surfaces (curves and points have no area)",
        remedy="export the part as a solid",
    )


def _diagonal_mm(bodies: list[Body]) -> float:
    corners = np.array([[body.vertices.min(axis=0), body.vertices.max(axis=0)] for body in bodies])
    extent = corners[:, 1].max(axis=0) - corners[:, 0].min(axis=0)
    return float(np.linalg.norm(extent)) * MM_PER_METRE


def _check_rounding(bodies: list[Body], tolerance_mm: float) -> None:
    """Refuse a part so far from the origin that single precision adds more than the tessellation does."""
    farthest_mm = max(float(np.abs(body.vertices).max()) for body in bodies) * MM_PER_METRE
    if farthest_mm * ROUNDING_SHARE > tolerance_mm:
        raise UnreadableFile(
            f"the part in the STEP lies {farthest_mm:.4g} mm from the origin, where its coordinates would be "
            f"rounded by {farthest_mm * ROUNDING_SHARE:.2g} mm",
            remedy="move the part to the origin in the CAD program, and export it again",
        )


def _several(bodies: list[Body], text: StepText) -> list[Note]:
    names = [body.name for body in bodies]
    if len(names) < 2:
        if text.solids < 2:
            return []
        names = list(text.solid_names)
    numbered = [f"{number} {name}".strip() for number, name in enumerate(names, start=1)]
    detail = (
        f"the STEP: {len(names)} {'parts' if len(bodies) > 1 else 'solids'} ({listed(numbered)}), and all of "
        "them are read as one part, where they are placed"
        + ("" if len(bodies) > 1 else "; their triangles are not closed: for one of them, export it alone")
    )
    return [Note(code="several_parts", detail=detail)]


def _surfaces(text: StepText) -> list[Note]:
    if not text.surfaces:
        return []
    beside = f"beside {text.solids} solids " if text.solids else "and no solid "
    detail = (
        f"the STEP: {text.surfaces} surface {'model' if text.surfaces == 1 else 'models'} {beside}"
        "were read as surface of the part; if they are help geometry, export the solid alone"
    )
    return [Note(code="step_surfaces", detail=detail)]


def _open(bodies: list[Body], text: StepText) -> list[Note]:
    """Solids whose triangles do not close: Open CASCADE leaves out a face that it cannot read."""
    if text.surfaces:
        return []
    found = [(body.name, n_open) for body in bodies if (n_open := _open_edges(body))]
    if not found:
        return []
    detail = (
        f"the STEP: the solid of {listed([name or 'a part without name' for name, _ in found])} is not "
        f"closed, with {sum(n for _, n in found)} open edges of triangles: faces are damaged and were left "
        "out, which shows as missing surface of the design; repair the solid in the CAD program"
    )
    return [Note(code="step_open_solid", detail=detail)]


def _open_edges(body: Body) -> int:
    """Edges of one triangle only, after vertices at the same place are one."""
    _, same = np.unique(body.vertices, axis=0, return_inverse=True)
    faces = same.ravel()[body.faces]
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    return int((np.unique(edges, axis=0, return_counts=True)[1] % 2 == 1).sum())


def _hidden(text: StepText) -> list[Note]:
    if not text.hidden_names:
        return []
    listing = listed([name or "without name" for name in text.hidden_names])
    one = len(text.hidden_names) == 1
    detail = (
        f"the STEP: {len(text.hidden_names)} {'solid is' if one else 'solids are'} hidden ({listing}) and "
        f"{'was' if one else 'were'} read as the others; if they are not the part, export it without them"
    )
    return [Note(code="step_hidden", detail=detail)]


def _elsewhere(text: StepText) -> list[Note]:
    if not text.external:
        return []
    detail = (
        f"the STEP: {text.external} references to other files, which were not sent: parts that are there "
        "are missing"
    )
    return [Note(code="left_out_of_step", detail=detail)]
