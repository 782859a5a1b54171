"""Parts by formula against closed forms, and the truth about their variants."""

from itertools import chain, islice

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels.surface import Surface
from tests.support import shapes
from tests.support.variants import bracket, catalogue, changes, solids
from tests.support.variants.bolt import Bolt
from tests.support.variants.bracket import Bracket
from tests.support.variants.difference import difference
from tests.support.variants.expected import FINDINGS, expected
from tests.support.variants.plate import Plate
from tests.support.variants.record import Scope, Variant, global_variant, local_variant
from tests.support.variants.thin_cover import Faces, thin_cover
from tests.support.variants.thin_walls import Normals, thin_wall_case, thin_wall_cases

USUAL_NOISE_SHARE = 0.001  # of the diagonal, as the condition `scan` of the gauntlet


@pytest.mark.parametrize("family", catalogue.FAMILIES)
def test_every_part_is_closed_with_its_volume_outside_in(family: str) -> None:
    mesh = catalogue.FAMILIES[family](0).mesh()
    assert solids.is_closed(mesh)
    assert solids.volume_mm3(mesh) > 0
    assert 40 <= mesh.diagonal_mm <= 120


@pytest.mark.nightly
@pytest.mark.parametrize("seed", catalogue.SEEDS)
def test_every_variant_is_closed_and_is_not_its_design(seed: int) -> None:
    for variant in catalogue.variants((seed,)):
        assert solids.is_closed(variant.design), variant.name
        assert solids.is_closed(variant.part), variant.name
        assert solids.volume_mm3(variant.part) > 0, variant.name
        assert variant.difference_rms_mm > 1e-3, variant.name
        assert 40 <= variant.design.diagonal_mm <= 125, variant.name  # with the second body
        noise_mm = USUAL_NOISE_SHARE * variant.design.diagonal_mm
        is_small = "0.3 %" in variant.name or "0.2 %" in variant.name
        assert expected(variant, noise_mm).is_visible != is_small, variant.name


@pytest.mark.nightly
def test_the_smallest_change_of_a_bracket_and_those_of_a_bolt_are_changes() -> None:
    of_bracket = islice(catalogue.feature_variants("bracket", 0), 1, 2)  # its hole, moved by 0.3 %
    for variant in chain(of_bracket, catalogue.shape_variants("bolt", 0)):
        assert variant.difference_rms_mm > 1e-3, variant.name
        assert variant.part.vertices.tobytes() != variant.design.vertices.tobytes()


@pytest.mark.parametrize(
    "part", [Bracket.sampled(0), pytest.param(Plate.sampled(0), marks=pytest.mark.nightly)]
)
def test_a_filled_hole_adds_the_volume_of_its_cylinder(part: Bracket | Plate) -> None:
    added = solids.volume_mm3(part.changes()["hole filled"].mesh()) - solids.volume_mm3(part.mesh())
    assert added == pytest.approx(part.hole_volume_mm3, rel=0.01)


def test_a_longer_part_is_longer_along_one_axis_only() -> None:
    design = shapes.bumpy_blob(3)
    extent = np.ptp(changes.stretched(design, 1, 0.04).vertices, axis=0) / np.ptp(design.vertices, axis=0)
    np.testing.assert_allclose(extent, [1.0, 1.04, 1.0], atol=1e-12)


def test_a_part_scaled_to_the_size_of_a_design_has_its_diagonal() -> None:
    assert changes.scaled_to(shapes.torus(), 73.0).diagonal_mm == pytest.approx(73.0, rel=1e-12)


def test_a_mirror_image_keeps_box_and_outward_normals() -> None:
    design = shapes.bumpy_blob(3)
    image = changes.mirror_image(design, 0)
    np.testing.assert_allclose(image.vertices.min(axis=0), design.vertices.min(axis=0), atol=1e-9)
    assert solids.volume_mm3(image) == pytest.approx(solids.volume_mm3(design))


def test_difference_is_zero_for_the_same_mesh_and_symmetric_for_two() -> None:
    blob, other = shapes.bumpy_blob(3), shapes.icosphere(17.0, 3)
    same = difference(blob, blob)
    assert same.rms_mm < 1e-9
    assert same.max_mm == same.area_above_mm2(1e-9) == 0
    one, two = difference(blob, other), difference(other, blob)
    assert one.rms_mm == pytest.approx(two.rms_mm, rel=1e-12)
    assert one.max_mm == pytest.approx(two.max_mm, rel=0.01)  # the changed region starts at another size
    assert one.area_above_mm2(0.5) == two.area_above_mm2(0.5)


def test_difference_of_two_spheres_is_that_of_their_radii() -> None:
    found = difference(shapes.icosphere(20.0, 5), shapes.icosphere(21.0, 5))
    assert found.rms_mm == pytest.approx(1.0, abs=0.01)
    assert found.max_mm == pytest.approx(1.0, abs=0.02)
    assert found.share_above(0.5) == 1.0


def test_the_same_seed_gives_the_same_bytes_and_another_one_another_part() -> None:
    for family, sampled in catalogue.FAMILIES.items():
        assert sampled(0) == sampled(0) != sampled(1), family
    part = Bracket.sampled(0)
    first = part.mesh()
    bracket._built.cache_clear()
    again = part.mesh()
    assert again is not first
    assert again.vertices.tobytes() == first.vertices.tobytes()
    assert again.faces.tobytes() == first.faces.tobytes()


def test_a_bolt_is_its_own_image_after_a_sixth_of_a_turn() -> None:
    bolt = Bolt(8, 50.0).mesh()
    T = np.eye(4)
    T[:2, :2] = [[0.5, -(0.75**0.5)], [0.75**0.5, 0.5]]
    assert difference(bolt, bolt.moved(T)).rms_mm < 0.02  # the chords of its circles


def _box_with_bump(height_mm: float) -> Mesh:
    plain = shapes.box((40.0, 30.0, 10.0), levels=4)
    offset = np.abs(plain.vertices - [20.0, 15.0, 10.0])
    rise = np.where((offset < [6.0, 5.0, 0.1]).all(axis=1), height_mm, 0.0)
    return Mesh(plain.vertices + rise[:, None] * [0.0, 0.0, 1.0], plain.faces)


def test_a_local_change_is_ok_below_the_noise_and_above_it_with_a_finding_only() -> None:
    variant = local_variant("bump", _box_with_bump(0.0), _box_with_bump(1.0))
    assert variant.difference_max_mm == pytest.approx(1.0, abs=0.02)
    hidden, seen = expected(variant, 0.5), expected(variant, 0.05)
    assert hidden.accepts("ok")
    assert not hidden.accepts("no_match")
    assert seen.needs_finding
    assert not seen.accepts("ok")
    assert all(seen.accepts("ok", [finding]) for finding in FINDINGS)
    assert seen.accepts("uncertain")
    assert not seen.is_borderline
    assert expected(variant, 0.24).is_borderline


def test_another_size_is_never_ok_when_seen() -> None:
    design = Bolt(8, 50.0)
    variant = global_variant("next", design.mesh(), design.next_size().mesh())
    assert variant.scope is Scope.GLOBAL
    assert not variant.is_same_outline
    assert 1.5 < variant.difference_max_mm < 2.1  # half of 16 - 13 mm across flats, 15 % more at corners
    assert not expected(variant, 0.05).accepts("ok", FINDINGS)
    assert expected(variant, 1.0).accepts("ok")


def test_a_moved_part_is_found_again_before_its_difference_is_measured() -> None:
    blob = shapes.bumpy_blob(2)
    variant = catalogue.other_shape("itself", blob, blob.moved(shapes.motion(3)))
    scale = blob.diagonal_mm / blob.moved(shapes.motion(3)).diagonal_mm
    assert variant.difference_rms_mm < 0.6 * abs(scale - 1) * blob.diagonal_mm
    assert variant.part.diagonal_mm == pytest.approx(blob.diagonal_mm)
    assert variant.T_design_part is None


def test_sides_of_a_thin_wall_lie_one_wall_apart() -> None:
    cover = thin_cover(1.5)
    assert solids.is_closed(cover.mesh)
    assert not (cover.is_outer & cover.is_inner).any()
    outer, inner = cover.surface(Faces.OUTER), cover.surface(Faces.INNER)
    size = np.ptp(outer.vertices, axis=0) - np.ptp(inner.vertices, axis=0)
    np.testing.assert_allclose(size, [3.0, 3.0, 1.5], atol=1e-6)
    middles = outer.vertices[outer.faces].mean(axis=1)
    assert np.median(Surface(inner).closest(middles).distance) == pytest.approx(1.5, abs=0.05)


def test_the_panel_fits_either_side_and_its_normals_tell() -> None:
    for faces in (Faces.PANEL_OUTER, Faces.PANEL_INNER):
        case = thin_wall_case(1.5, faces, Normals.ABSENT)
        assert case.T_other_side is not None
        assert case.scan_surface.is_cloud
        assert not case.is_side_tellable
        for T in (np.eye(4), case.T_other_side):
            assert Surface(case.design).closest(case.scan_surface.moved(T).vertices).distance.max() < 1e-6
        right, flipped = (thin_wall_case(1.5, faces, way) for way in (Normals.RIGHT, Normals.REVERSED))
        up = 1.0 if faces is Faces.PANEL_OUTER else -1.0
        assert (right.scan_surface.face_cross_mm2()[:, 2] * up > 0).all()
        assert (flipped.scan_surface.face_cross_mm2()[:, 2] * up < 0).all()
        assert right.is_side_tellable
        assert not flipped.is_side_tellable


@pytest.mark.nightly
def test_all_thin_walls_are_made_and_too_thin_ones_tell_nothing() -> None:
    cases = list(thin_wall_cases(noise_mm=0.3))
    assert len(cases) == len({case.name for case in cases}) == 60
    assert all(solids.is_closed(case.design) for case in cases)
    assert not any(case.is_side_tellable for case in cases if case.wall_mm <= 1.0)
    assert any(case.is_side_tellable for case in cases)


def test_a_whole_side_moved_by_a_wall_is_off_in_a_few_places_only() -> None:
    case = thin_wall_case(1.5, Faces.OUTER, Normals.ABSENT)
    assert case.is_side_tellable
    assert 0.01 < case.other_side_share < 0.1
    assert 0.05 < case.other_side_rms_mm < 0.3
    assert thin_wall_case(1.5, Faces.BOTH, Normals.ABSENT).T_other_side is None


def test_a_wall_out_of_range_is_refused() -> None:
    with pytest.raises(ValueError, match="wall_mm"):
        thin_cover(0.2)


def test_a_mirror_image_that_differs_in_a_spot_is_ok_with_a_finding_and_an_odd_one_is_not() -> None:
    spot, odd = _box_with_bump(3.0), shapes.bumpy_blob(2)
    moved_bump = Mesh(spot.vertices + _aside(spot), spot.faces)
    local, overall = (
        expected(Variant("", Scope.MIRRORED, mesh, image, difference(mesh, image), np.eye(4)), 0.1)
        for mesh, image in ((mesh, changes.mirror_image(mesh, 0)) for mesh in (moved_bump, odd))
    )
    assert local.accepts("mirrored")
    assert overall.accepts("mirrored")
    assert not overall.accepts("ok", FINDINGS)
    assert local.is_visible
    assert overall.is_visible
    assert local.accepts("ok", FINDINGS)
    assert not local.accepts("ok")


def _aside(box: Mesh) -> FloatArray:
    """Shifts of the vertices of the bump, which take its mirror symmetries."""
    is_bump = box.vertices[:, 2] > 10.5
    return np.where(is_bump, 1.0, 0.0)[:, None] * [4.0, 3.0, 0.0]
