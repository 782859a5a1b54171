"""A table that the part stands on, in one piece with it: a flat surface wider than the design is none of it.

Only a scan with a piece larger than the design is looked at.
"""

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IntArray, Mesh
from pipeline.kernels.flat_patch import largest_flat_patch
from pipeline.kernels.pieces import Pieces
from pipeline.stages.clean import Cleaned
from pipeline.stages.strays import MAX_PART_SIZE, MIN_PART_SIZE, NO_STRAYS, Strays, sizes, strays_of, without

#: Of the diagonal of the design: how far from a plane a bent table lies, and how near to the bent surface the
#: rest is cut off. Chosen by hand: cameras bend by 1 % and more.
COARSE_SHARE, FINEST_SHARE = 0.03, 0.004
#: A table holds at least this share of the points of the scan. Chosen by hand.
MIN_TABLE_SHARE = 0.15
#: A scan of more than so many diameters of the design may as well be in another unit (the least factor is
#: 10): it is left as it is. Chosen by hand.
MAX_SCENE_SIZE = 6.0
#: Of the largest piece of what is left: smaller ones are shreds of the table. Chosen by hand.
SHRED_SHARE = 0.05
#: A table, and what it stands before. Chosen by hand.
MAX_TABLES = 2


def without_table(cleaned: Cleaned, design: Mesh, seed: int) -> tuple[Cleaned, Strays]:
    """A scan without the flat surfaces that are wider than the design, where what is left may be the part."""
    mesh = cleaned.mesh
    largest = float(sizes(Pieces.of(mesh), mesh, design).max())
    if not MAX_PART_SIZE < largest <= MAX_SCENE_SIZE:
        return cleaned, NO_STRAYS
    whole = Pieces.numbered(design, np.zeros(len(design.vertices), dtype=np.int32))
    widest_mm = MAX_PART_SIZE * float(whole.diameters_mm(design)[0])
    table = np.zeros(len(mesh.vertices), dtype=np.bool_)
    for _ in range(MAX_TABLES):
        rows = np.flatnonzero(~table)
        shares = (COARSE_SHARE * design.diagonal_mm, FINEST_SHARE * design.diagonal_mm)
        patch = largest_flat_patch(mesh.vertices[rows], *shares, seed, MIN_TABLE_SHARE)
        if patch is None or patch.width_mm < widest_mm:
            break
        table[rows[patch.is_on]] = True
    kept = _without_shreds(mesh, ~table) if table.any() else ~table
    if kept.all() or not _may_be_part(mesh, kept, design):
        return cleaned, NO_STRAYS
    pieces = Pieces.numbered(mesh, (~kept).astype(np.int32))
    left_out = np.array([False, True])
    reason = "a flat surface wider than the design, as a table"
    return without(cleaned, pieces, left_out), strays_of(pieces, left_out, reason)


def _without_shreds(mesh: Mesh, kept: BoolArray) -> BoolArray:
    """(n,) of the kept vertices those in pieces that are not small; all corners of a triangle, or none."""
    rows, rest = _cut(mesh, kept)
    large = np.zeros(len(mesh.vertices), dtype=np.bool_)
    if len(rows):
        pieces = Pieces.of(rest)
        large[rows] = (pieces.weight >= SHRED_SHARE * pieces.weight.max())[pieces.of_vertex]
    return large


def _may_be_part(mesh: Mesh, kept: BoolArray, design: Mesh) -> bool:
    rows, rest = _cut(mesh, kept)
    if not len(rows):
        return False
    size: FloatArray = sizes(Pieces.of(rest), rest, design)
    return bool(((size >= MIN_PART_SIZE) & (size <= MAX_PART_SIZE)).any())


def _cut(mesh: Mesh, kept: BoolArray) -> tuple[IntArray, Mesh]:
    """Numbers of the kept vertices that are left, and the mesh of them: triangles with all corners kept."""
    if mesh.is_cloud:
        rows = np.flatnonzero(kept)
        return rows.astype(np.int32), Mesh(mesh.vertices[rows])
    faces = mesh.faces[kept[mesh.faces].all(axis=1)]
    rows = np.unique(faces)
    return rows.astype(np.int32), Mesh(mesh.vertices[rows], np.searchsorted(rows, faces).astype(np.int32))
