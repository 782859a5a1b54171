"""Stray pieces: what lies in a file beside the part, and would stretch or outweigh it. Dust, a speck far off,
the table or a clamp of a scan.

Every limit of the method is a share of the size of the design, so that a speck must not stretch it; and a
scan is judged by what was scanned of the part, not of the table.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.core.results import Note
from pipeline.core.sentences import figure, place
from pipeline.kernels.nearest import nearest
from pipeline.kernels.pieces import Pieces
from pipeline.kernels.surface import Surface
from pipeline.stages.clean import Cleaned
from pipeline.stages.cloud_specks import near_specks

#: The part: the fewest pieces that hold this share of the area. From the requirement.
PART_SHARE = 0.999
#: Each piece below the first share of the area is small too, where all of them hold at most the second: ten
#: specks together may hold more than `PART_SHARE` leaves. Chosen by hand: ten balls of 1 % of the diagonal.
DUST_PIECE_SHARE, DUST_SHARE = 0.002, 0.02
#: A small piece is a stray when it lies farther from the part than this share of the part's diagonal, or than
#: `APART_MM`; what is nearer (a letter on a plate) belongs to it. Chosen by hand; printed parts that move in
#: each other have gaps of 0.2 to 0.5 mm.
APART_SHARE, APART_MM = 0.005, 0.6
#: A piece of less than this share of the area is a stray too when it lies far from the larger ones: farther
#: than `FAR_SHARE` of their diagonal. Chosen by hand.
FAR_AREA_SHARE, FAR_SHARE = 0.02, 0.1
#: Such pieces hold at most this share of the area; more of them are a part in pieces. Chosen by hand.
MAX_FAR_SHARE = 0.1
#: A piece of a scan is no part of the design where its diameter is above this many diameters of the design,
#: and a piece above `MIN_PART_SIZE` and below it is there too. Chosen by hand: noise and flying points add.
MAX_PART_SIZE, MIN_PART_SIZE = 1.2, 0.3
#: Of a scan on its design: a piece of which less than this share lies within the inlier distance is a stray,
#: where the rest covers at least `MIN_REST_COVERAGE` of the design, or the strays are at most
#: `MAX_SHARE_OF_SMALL_REST` of the scan. Chosen by hand.
ON_DESIGN_SHARE, MIN_REST_COVERAGE, MAX_SHARE_OF_SMALL_REST = 0.25, 0.15, 0.3

#: Pieces of a scan that are tried alone where the whole does not fit: at least this share of it each, and the
#: largest few. Chosen by hand; each costs a registration.
MIN_CANDIDATE_SHARE, MAX_CANDIDATES = 0.1, 3


@dataclass(frozen=True, slots=True)
class Strays:
    """Pieces that were left out of one mesh. size_mm : (s,) diagonal of the box of each; centre_mm : (s, 3)
    its centre, in the frame of the mesh; share : (s,) of the area of the mesh, of a cloud of its points;
    reason : why they are none of the part
    """

    size_mm: FloatArray
    centre_mm: FloatArray
    share: FloatArray
    reason: str

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return len(self.share) > 0

    def notes(self, name: str) -> list[Note]:
        """One warning for all of them. name : `design` or `scan`"""
        if not self.any:
            return []
        largest = int(self.share.argmax())
        where = place(self.centre_mm[largest], 1)
        one = len(self.share) == 1
        pieces = "1 piece was" if one else f"{len(self.share)} pieces were"
        detail = (
            f"{name}: {pieces} left out ({figure(100 * float(self.share.sum()), 2)} % of it; {self.reason}); "
            f"{'it' if one else 'the largest'} is "
            f"{figure(self.size_mm[largest])} mm in size and lies at {where} mm. Pose, overlap, "
            "deviation and "
            "all files are of the rest"
        )
        return [Note(code="stray_component", detail=detail)]


NO_STRAYS = Strays(np.zeros(0), np.zeros((0, 3)), np.zeros(0), "")


def without_specks(cleaned: Cleaned) -> tuple[Cleaned, Strays]:
    """The mesh without small pieces that lie apart from the rest."""
    mesh = cleaned.mesh
    pieces = Pieces.of(mesh)
    stray = _specks(mesh, pieces) if pieces.count > 1 else np.zeros(1, dtype=np.bool_)
    if mesh.is_cloud:  # its pieces are coarse: a speck that is nearer is one with the part
        stray_points = stray[pieces.of_vertex]
        near = near_specks(mesh, ~stray_points, min(APART_SHARE * pieces.diagonal_mm(~stray), APART_MM))
        if near is not None:
            pieces = Pieces.numbered(mesh, near.numbers(pieces.of_vertex))
            stray = np.zeros(pieces.count, dtype=np.bool_)
            stray[pieces.of_vertex[stray_points | near.is_speck]] = True
    reason = "small, and apart from the part"
    return without(cleaned, pieces, stray), strays_of(pieces, stray, reason)


def without_oversize(cleaned: Cleaned, design: Mesh) -> tuple[Cleaned, Strays]:
    """A scan without pieces that are larger than the design, as a table is, where the rest may be the
    part.
    """
    pieces = Pieces.of(cleaned.mesh)
    if pieces.count == 1:
        return cleaned, NO_STRAYS
    size = sizes(pieces, cleaned.mesh, design)
    stray = size > MAX_PART_SIZE
    if not (size[~stray] >= MIN_PART_SIZE).any():
        stray = np.zeros(pieces.count, dtype=np.bool_)
    reason = "larger than the design"
    return without(cleaned, pieces, stray), strays_of(pieces, stray, reason)


def without_off_design(
    cleaned: Cleaned, distance_mm: FloatArray, inlier_distance_mm: float, design: Surface
) -> tuple[Cleaned, Strays]:
    """A scan without the pieces that lie nowhere on the design, under the best pose.

    distance_mm : (n,) of each vertex from the design. Nothing is left out where what remains shows too little
    of the design to be judged by it.
    """
    pieces, weights = Pieces.of(cleaned.mesh), cleaned.mesh.weights()
    inside = np.bincount(
        pieces.of_vertex, weights=weights * (distance_mm <= inlier_distance_mm), minlength=pieces.count
    )
    share = pieces.weight / pieces.weight.sum()
    stray = inside < ON_DESIGN_SHARE * share
    left_out = float(share[stray].sum())
    if left_out > MAX_SHARE_OF_SMALL_REST:
        rest_mm2 = 0.0 if cleaned.mesh.is_cloud else float(pieces.weight[~stray].sum())
        if rest_mm2 < MIN_REST_COVERAGE * float(design.mesh.face_areas_mm2().sum()):
            stray = np.zeros(pieces.count, dtype=np.bool_)
    reason = "nowhere on the design"
    return without(cleaned, pieces, stray), strays_of(pieces, stray, reason)


def piece_candidates(cleaned: Cleaned, design: Mesh) -> list[int]:
    """Pieces of a scan that may each be the part, by their size and share, largest first; none where there
    is one piece only. A surface of less than `MIN_REST_COVERAGE` of the design's area fits on many a part.
    """
    pieces = Pieces.of(cleaned.mesh)
    size, share = sizes(pieces, cleaned.mesh, design), pieces.weight / pieces.weight.sum()
    likely = (size >= MIN_PART_SIZE) & (size <= MAX_PART_SIZE)
    likely &= (share >= MIN_CANDIDATE_SHARE) & (share < 1.0)
    if not cleaned.mesh.is_cloud:
        likely &= pieces.weight >= MIN_REST_COVERAGE * float(design.face_areas_mm2().sum())
    order = np.argsort(-share, kind="stable")
    return [int(number) for number in order if likely[number]][:MAX_CANDIDATES]


def only_piece(cleaned: Cleaned, piece: int) -> tuple[Cleaned, Strays]:
    """A scan without all but one of its pieces."""
    pieces = Pieces.of(cleaned.mesh)
    stray = np.ones(pieces.count, dtype=np.bool_)
    stray[piece] = False
    reason = "apart from the piece that fits the design"
    return without(cleaned, pieces, stray), strays_of(pieces, stray, reason)


def _specks(mesh: Mesh, pieces: Pieces) -> BoolArray:
    part = pieces.largest(PART_SHARE) & ~_dust(pieces)
    far = _far_off(pieces)
    part &= ~far
    small = ~part & ~far
    if not small.any():
        return far
    apart_mm = min(APART_SHARE * pieces.diagonal_mm(part), APART_MM)
    stray = small & (pieces.box_gaps_mm(part) > apart_mm)
    unsure = small & ~stray
    if unsure.any():
        vertex = np.flatnonzero(unsure[pieces.of_vertex])
        on_part = part[pieces.of_vertex]
        if mesh.is_cloud:
            distance, _ = nearest(mesh.vertices[on_part], mesh.vertices[vertex])
        else:
            faces = mesh.faces[on_part[mesh.faces[:, 0]]]
            distance = Surface(Mesh(mesh.vertices, faces)).closest(mesh.vertices[vertex]).distance
        nearest_mm = np.full(pieces.count, np.inf)
        np.minimum.at(nearest_mm, pieces.of_vertex[vertex], distance)
        stray |= unsure & (nearest_mm > apart_mm)
    return stray | far


def sizes(pieces: Pieces, mesh: Mesh, design: Mesh) -> FloatArray:
    """(p,) diameter of each piece over that of the design."""
    whole = np.zeros(len(design.vertices), dtype=np.int32)
    low, high = design.vertices.min(axis=0)[None], design.vertices.max(axis=0)[None]
    of_design = Pieces(whole, np.ones(1), low, high).diameters_mm(design)
    return np.asarray(pieces.diameters_mm(mesh) / of_design[0])


def _dust(pieces: Pieces) -> BoolArray:
    """(p,) pieces so small, and so few of them, that none is a part of the part."""
    share = pieces.weight / pieces.weight.sum()
    small = share < DUST_PIECE_SHARE
    is_little = float(share[small].sum()) <= DUST_SHARE
    return np.asarray(small & is_little)


def _far_off(pieces: Pieces) -> BoolArray:
    """(p,) small pieces far from all large ones."""
    share = pieces.weight / pieces.weight.sum()
    core = share >= min(FAR_AREA_SHARE, 0.5 * share.max())  # or pieces of one size
    far = ~core & (pieces.box_gaps_mm(core) > FAR_SHARE * pieces.diagonal_mm(core))
    is_dust = float(share[far].sum()) <= MAX_FAR_SHARE
    return np.asarray(far & is_dust)


def without(cleaned: Cleaned, pieces: Pieces, stray: BoolArray) -> Cleaned:
    """The mesh without the `stray` pieces (p,), and without triangles that have a corner on one."""
    if not stray.any():
        return cleaned
    mesh = cleaned.mesh
    kept = ~stray[pieces.of_vertex]
    faces = mesh.faces
    if not mesh.is_cloud:
        faces = (np.cumsum(kept) - 1)[faces[kept[faces].all(axis=1)]].astype(np.int32)
    rest = Mesh(mesh.vertices[kept], faces)
    count = int(cleaned.report.get("stray_components", 0)) + int(stray.sum())
    report = cleaned.report | {
        "stray_components": count,
        "vertices": len(rest.vertices),
        "faces": len(rest.faces),
    }
    return Cleaned(rest, cleaned.old_of_new[kept], report)


def strays_of(pieces: Pieces, stray: BoolArray, reason: str) -> Strays:
    """The record of the `stray` pieces (p,)."""
    return Strays(
        pieces.diagonals_mm()[stray],
        (pieces.low[stray] + pieces.high[stray]) / 2,
        pieces.weight[stray] / pieces.weight.sum(),
        reason,
    )
