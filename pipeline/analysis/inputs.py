"""Reading the meshes of a job: load, clean, and what the results say about each input."""

from dataclasses import dataclass, replace

from pipeline.analysis.brep_segments import on_cleaned
from pipeline.core.brep_faces import BrepFaces
from pipeline.core.mesh import Mesh
from pipeline.core.mesh_file import MeshFile
from pipeline.core.progress import Stage
from pipeline.core.results import Input, Note
from pipeline.core.sentences import figure
from pipeline.core.settings import Settings
from pipeline.core.stations import Stations
from pipeline.core.timing import StageTimer
from pipeline.stages.clean import Cleaned, clean
from pipeline.stages.load import Loaded, load
from pipeline.stages.strays import Strays, without_specks


@dataclass(frozen=True, slots=True)
class InputMesh:
    """One mesh of a job, read. name : `design`, `scan` or `mesh`; loaded : as in the file, in mm; cleaned :
    what every later stage works on; strays : what was left out of it
    """

    name: str
    loaded: Loaded
    cleaned: Cleaned
    strays: tuple[Strays, ...] = ()

    @property
    def mesh(self) -> Mesh:
        """The cleaned mesh, which `vertex` in the results indexes."""
        return self.cleaned.mesh

    @property
    def stations(self) -> Stations | None:
        """Where the scanner stood, of the vertices of `mesh`; None where the file does not say."""
        stations = self.loaded.stations
        return None if stations is None else stations.chosen(self.cleaned.old_of_new)

    def brep_faces(self) -> BrepFaces | None:
        """The faces of the CAD model, on the triangles of `mesh`; None where the file has none."""
        brep = self.loaded.brep
        return None if brep is None else on_cleaned(self.mesh, self.loaded.mesh, brep)

    @property
    def left_out_share(self) -> float:
        """Share of the area (of a cloud: of the points) in stray pieces that were left out."""
        kept = 1.0
        for strays in self.strays:
            kept *= 1.0 - float(strays.share.sum())
        return 1.0 - kept

    def without(self, cleaned: Cleaned, strays: Strays) -> "InputMesh":
        """The same with more left out. strays : what `cleaned` no longer has"""
        return replace(self, cleaned=cleaned, strays=(*self.strays, strays)) if strays.any else self

    def record(self) -> Input:
        """Its entry in `provenance.inputs`."""
        return Input(
            sha256=self.loaded.sha256,
            format=self.loaded.format.value,
            unit=self.loaded.unit,
            mm_per_unit=self.loaded.mm_per_unit,
            part=self.loaded.part,
            columns=self.loaded.columns,
            cleaning=self.cleaned.report,
        )

    def warnings(self) -> list[Note]:
        """What cleaning changed that a person should look at."""
        notes, report = list(self.loaded.notes), self.cleaned.report
        notes += self._bodies()
        dropped = int(report.get("non_manifold_faces", 0))
        if dropped:
            detail = f"{self.name}: triangles removed at edges that more than two triangles share: {dropped}"
            notes.append(Note(code="non_manifold", detail=detail))
        if report.get("turned_faces", 0):
            detail = (
                f"{self.name}: triangles flipped because they faced the wrong way: {report['turned_faces']}"
            )
            notes.append(Note(code="turned_faces", detail=detail))
        if self.mesh.is_cloud:
            detail = (
                f"{self.name}: the file is a point cloud; a surface was reconstructed for the "
                "analysis, and deviations are measured at the points"
            )
            notes.append(Note(code="point_cloud", detail=detail))
        return [*notes, *(note for strays in self.strays for note in strays.notes(self.name))]

    def _bodies(self) -> list[Note]:
        """What became of bodies that touch or overlap."""
        report, notes = self.cleaned.report, []
        if united := int(report.get("united_bodies", 0)):
            area_mm2 = float(report["internal_area_mm2"])
            share = area_mm2 / (area_mm2 + float(self.mesh.face_areas_mm2().sum()))
            detail = (
                f"{self.name}: {united} bodies touch or overlap and were united; {figure(area_mm2, 4)} "
                "mm² of their "
                f"surface ({100 * share:.1f} %) lies inside the part, is left out and is not measured"
            )
            if filled := int(report["filled_voids"]):
                detail += f"; thin gaps between them, where their triangles differ, were filled: {filled}"
            notes.append(Note(code="bodies_united", detail=detail))
        if within := int(report.get("faces_within_others", 0)):
            detail = (
                f"{self.name}: triangles inside the part were left out and are not measured: {within}, of "
                f"{figure(report['area_within_others_mm2'], 4)} mm²; they are of bodies with small holes, or "
                "within such bodies: close the holes, so that the bodies can be united"
            )
            notes.append(Note(code="within_open_bodies", detail=detail))
        # the pieces of a scan are open because the scanner saw no more
        if self.name == "design" and (apart := int(report.get("bodies_not_united", 0))):
            detail = (
                f"{self.name}: surfaces that may touch or overlap others, but are not closed or cannot be "
                f"united: {apart}; walls between them stay, and count as surface of the design: close the "
                "bodies, or export the part as one solid"
            )
            notes.append(Note(code="bodies_not_united", detail=detail))
        return notes


def read_mesh(
    file: MeshFile, name: str, settings: Settings, timer: StageTimer, *, needs_surface: bool
) -> InputMesh:
    """Load and clean one mesh. needs_surface : False accepts a point cloud

    Raises
    ------
    PipelineError
        When the file is unreadable, or nothing usable is left of it.
    """
    with timer.stage(Stage.LOAD, name):
        loaded = load(file, name, settings.load, needs_surface=needs_surface)
    with timer.stage(Stage.CLEAN, name):
        cleaned, specks = without_specks(clean(loaded.mesh, name, settings.clean, loaded.body_of_face))
        return InputMesh(name, loaded, cleaned, (specks,) if specks.any else ())
