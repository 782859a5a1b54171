"""Settings of the stages on one mesh, from load to landmarks."""

from typing import Literal

from pydantic import Field

from pipeline.core.settings.base import Detector, Section, SegmentationMethod


class LoadSettings(Section):
    max_faces: int = Field(5_000_000, ge=1, le=200_000_000, description="refuse a mesh with more triangles")
    max_points: int = Field(
        10_000_000,
        ge=1,
        le=200_000_000,
        description="refuse a cloud with more points, or a mesh with more vertices that has also more than "
        "three for each triangle: where faces share no vertices, as in STL, `max_faces` limits them",
    )
    max_archive_expansion: int = Field(
        200,
        ge=1,
        le=10_000,
        description="refuse a file (3MF, AMF, glTF in a zip, VTP) that unpacks to more than this many times "
        "its size (zip bomb)",
    )

    def allows(self, n_vertices: int, n_faces: int) -> bool:
        """Whether a mesh or cloud is within the limits. Triangles with vertices of their own have up to three
        each, of which a sixth is left when equal ones are merged.
        """
        return n_faces <= self.max_faces and n_vertices <= max(self.max_points, 3 * n_faces)

    @property
    def max_vertices(self) -> int:
        """Of any mesh or cloud within the limits, before its triangles are known."""
        return max(self.max_points, 3 * self.max_faces)


class CleanSettings(Section):
    weld_share: float = Field(
        1e-6,
        ge=0,
        le=1e-3,
        description="merge border vertices closer than this share of the diagonal; 0 is off",
    )
    repair_non_manifold: bool = Field(
        True, description="remove faces at edges that more than two faces share"
    )
    unite_bodies: bool = Field(
        True,
        description="unite closed bodies that touch or overlap: the walls between them are no surface; false "
        "keeps all their triangles",
    )
    min_component_share: float = Field(
        0.0, ge=0, lt=1, description="drop connected pieces below this share of the area; 0 keeps all"
    )


class ResampleSettings(Section):
    enabled: bool = Field(
        True, description="analyse an isotropic working mesh instead of the file's triangles"
    )
    target_vertices: int = Field(
        4000,
        ge=200,
        le=200_000,
        description="vertices of the design's working mesh; the scan gets the same edge length",
    )
    iterations: int = Field(5, ge=1, le=50, description="passes of isotropic remeshing")
    max_scan_ratio: float = Field(
        3.0,
        ge=1,
        le=20,
        description="the scan's working mesh has at most this many times the target vertices",
    )


class GeodesicsSettings(Section):
    metric: Literal["surface", "crease"] = Field(
        "crease",
        description="length of a path: along the surface (paper), or longer where it crosses valleys",
    )
    crease_beta: float = Field(
        4.0, ge=0, le=100, description="crossing a valley costs twice this many times its depth"
    )
    crease_radius_share: float = Field(
        0.03,
        gt=0,
        lt=0.5,
        description="width of the valleys that count, as a share of sqrt(area of the design)",
    )


class SegmentationSettings(Section):
    """Density peaks: Rodriguez & Laio 2014; the other methods are for comparison (the paper's figure 1)."""

    method: SegmentationMethod = Field(
        "cfsfdp", description="density peaks, or a clustering of vertex positions to compare with"
    )
    quantile: float = Field(0.005, gt=0, lt=1, description="d_c is this quantile of all pairwise distances")
    density: Literal["vertex", "area", "convexity"] = Field(
        "convexity",
        description="density rho: number of vertices (paper), their area, or area weighted by height on a "
        "bump",
    )
    convexity_radius_share: float = Field(
        0.13, gt=0, lt=1, description="size of the bumps, as a share of sqrt(area of the design)"
    )
    convexity_sharpness: float = Field(
        0.03,
        gt=0,
        le=10,
        description="share of that size by which a vertex must be higher to weigh e times as much",
    )
    kernel: Literal["cutoff", "gaussian"] = Field(
        "gaussian",
        description="weight of a neighbour in rho: 1 below d_c (eq. 1), or exp(-(d / d_c)^2)",
    )
    n_centres: int | None = Field(
        None, ge=1, le=10_000, description="number of centres; null: by the rule below"
    )
    rho_min: float | None = Field(
        None, ge=0, description="centres are the vertices with at least this rho and delta_min_mm"
    )
    delta_min_mm: float | None = Field(None, ge=0, description="see rho_min; either may be given alone")
    centre_rule: Literal["prominence", "decision_graph"] = Field(
        "prominence",
        description="without the three above: merge peaks over dense borders, or thresholds (paper)",
    )
    min_prominence: float = Field(
        4.33, ge=0, description="prominence: a centre stays when its log rho is this much above its borders'"
    )
    delta_min_dc: float = Field(
        1.5,
        ge=0,
        description="decision_graph: a centre has delta of at least this many d_c (prominence starts from 1)",
    )
    rho_min_share: float = Field(
        0.5, ge=0, le=1, description="decision_graph: and rho of at least this share of the median rho"
    )
    max_centres: int = Field(
        64, ge=1, le=10_000, description="decision_graph: maximum number, largest rho * delta first"
    )
    min_component_share: float = Field(
        0.01, ge=0, lt=1, description="a connected piece needs this share of the area to have a centre"
    )


class FeaturesSettings(Section):
    kind: Literal["physical", "integrated"] = Field(
        "physical",
        description="curvatures averaged over radius (default) or PyMesh's integrated ones (paper)",
    )
    radius_share: float = Field(
        0.1, gt=0, lt=0.5, description="averaging radius as a share of sqrt(area of the design)"
    )
    radius_mm: float | None = Field(None, gt=0, description="the same in mm; overrides the share")
    target_vertices: int = Field(
        8000,
        ge=200,
        le=400_000,
        description="vertices of the finer mesh of the design that features are computed on",
    )


class LandmarksSettings(Section):
    detector: Detector = Field(
        "t2",
        description="T^2 in each segment (the method), or a competitor: see `pipeline/stages/detectors.py`",
    )
    count: int | None = Field(
        None,
        ge=1,
        le=10_000,
        description="maximum number, strongest first; null: all (competitors: as many as t2)",
    )
    confidence: float = Field(
        0.5,
        gt=0,
        lt=1,
        description="alpha of the T^2 limit (eq. 3); for maxima only, 0.97 (paper) would leave very few",
    )
    statistics: Literal["part", "segment"] = Field(
        "part",
        description="T^2 by the part's covariance and the segment's own size of spread, or by the segment's "
        "(paper)",
    )
    standardize: bool = Field(
        True,
        description="segment: one scale a feature (one common scale for l1..l3); false: covariance PCA "
        "(paper)",
    )
    include_halo: bool = Field(
        True, description="use halo vertices for the PCA and as landmarks (paper: false)"
    )
    min_segment_vertices: int = Field(
        30,
        ge=8,
        description="smaller segments take the spread of the part, or with `segment` get no landmarks",
    )
    border_distance_radii: float = Field(
        0.5,
        ge=0,
        description="no landmark closer to an open border than this many feature radii; 0 is off (paper)",
    )
    spacing_radii: float = Field(
        0.4,
        ge=0,
        description="of landmarks within this many feature radii the strongest stays; 0 is off (paper)",
    )
    min_relief: float = Field(
        0.02,
        ge=0,
        description="a segment whose spread of mean curvature times feature radius is below this gets no "
        "landmarks",
    )
    localize_radii: float = Field(
        0.3,
        ge=0,
        le=2,
        description="landmarks are maxima of T^2, located by a quadric fitted over this many feature radii; "
        "0: every vertex beyond the limit (paper)",
    )
    min_sharpness: float = Field(
        0.2,
        description="T must fall this fast in every direction (its second derivative times radius^2 over "
        "T): no ridges",
    )
