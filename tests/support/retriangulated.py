"""Another triangulation of a part, for simulated scans: by pymeshlab, not as working meshes are made."""

from pipeline.core.mesh import Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import remesh
from pipeline.stages.clean import clean

#: A part of more than this many times the triangles asked for is decimated first, to half as many.
DECIMATE_ABOVE = 8
#: Passes of remeshing; fewer where nearly all edges (`NEARLY_ALL`) are below `SHORT_EDGES` edges.
PASSES, FEW_PASSES, NEARLY_ALL, SHORT_EDGES = 4, 3, 0.99, 2.0


def retriangulated(part: Mesh, edge_mm: float) -> Mesh:
    """The same surface with edges of about `edge_mm`."""
    wanted = float(part.face_areas_mm2().sum()) / (3**0.5 / 4 * edge_mm**2)
    if len(part.faces) > DECIMATE_ABOVE * wanted:
        part = remesh.decimated(part, int(DECIMATE_ABOVE / 2 * wanted))
    passes = FEW_PASSES if remesh.edge_mm(part, NEARLY_ALL) <= SHORT_EDGES * edge_mm else PASSES
    return clean(remesh.isotropic(part, edge_mm, passes), "scan", CleanSettings()).mesh
