"""Named views, pins and cross-sections of the report: the same sides as on the page, true places."""

import re
from pathlib import Path

import numpy as np
import pytest

import service
from pipeline.core.mesh import Mesh
from pipeline.report import cross_section
from pipeline.report.colormap import ColourScale
from pipeline.report.cross_section import Place
from pipeline.report.shots import LINE_PX, Pin, labels_of, render_view, round_below, spread
from pipeline.report.views import DIRECTIONS, named_view, standard_views, views_facing
from tests.support.shapes import box, icosphere


def test_the_views_are_those_of_the_page() -> None:
    text = (Path(service.__file__).parent / "web" / "views.js").read_text()
    said = re.findall(r"'?([+\N{MINUS SIGN}]?\w+)'?: \[([-\d., ]+)\]", text)
    assert {name: [float(x) for x in numbers.split(",")] for name, numbers in said} == DIRECTIONS
    for name in DIRECTIONS:
        axes = named_view(name).axes
        assert np.allclose(axes @ axes.T, np.eye(3)) and np.linalg.det(axes) == pytest.approx(1)


def test_a_flat_part_is_seen_from_both_flat_sides() -> None:
    assert standard_views(box((30.0, 5.0, 20.0)))[::2] == ["+y", "\N{MINUS SIGN}y"]
    assert views_facing(np.array([0.0, 0, 2.0]))[0] == "+z"
    assert "\N{MINUS SIGN}z" not in views_facing(np.array([0.1, 0, 1.0]))


def test_pins_are_where_their_places_are_and_hidden_behind_the_part() -> None:
    ball = icosphere(10.0, 4)
    view = render_view(ball, np.ones((len(ball.vertices), 3)), ball, "+z")
    pins = [
        Pin("front", np.array([0.0, 0, 10])),
        Pin("back", np.array([1.0, 0, -9.9])),
        Pin("side", np.array([8.0, 0, 6.0])),
    ]
    labels = {label.words: label for label in labels_of(view, pins)}
    assert {words: label.is_hidden for words, label in labels.items()} == {
        "front": False,
        "back": True,
        "side": False,
    }
    radius_px = 10.0 / view.framing.mm_per_px
    assert labels["side"].x - labels["front"].x == pytest.approx(0.8 * radius_px, abs=1.0)


def test_labels_lie_a_line_apart_and_inside() -> None:
    tops = spread([50.0, 51.0, 52.0, 299.0, 300.0], 10.0, 300.0)
    assert (np.diff(tops) >= LINE_PX - 1e-9).all() and tops[0] == 50.0 and tops[-1] == 300.0
    assert [round_below(value) for value in (0.13, 1.0, 49.9)] == [0.1, 1.0, 20.0]


@pytest.mark.parametrize(("depth_mm", "factor"), [(0.5, 1), (-0.05, 10)])
def test_a_section_shows_the_deviation_so_many_times_as_large(depth_mm: float, factor: int) -> None:
    """A ball whose radius is `depth_mm` larger, on a ball of 10 mm: arcs of 10 and 10 + factor * depth_mm."""
    design, scan = icosphere(10.0, 5), icosphere(10.0 + depth_mm, 5)
    place = Place(scan.vertices[scan.vertices[:, 0].argmax()], depth_mm)
    values = np.full(len(scan.vertices), depth_mm)
    caption, svg = cross_section.draw(place, design, scan, values, ColourScale(1.0, None))
    assert f"drawn {factor} times" in caption
    axis = "xyz".index(re.findall(r"plane (.) =", caption)[0])
    assert place.position_mm[axis] == pytest.approx(0.0, abs=1e-6)  # the arcs are great circles
    right, up = cross_section.ACROSS[axis]
    window_mm = max(0.15 * design.diagonal_mm, 6 * abs(depth_mm))
    mm_per_point = window_mm / cross_section.WIDTH
    radii: dict[bool, list[float]] = {True: [], False: []}
    for path, pen in re.findall(r'<path d="(M[^"]*)" stroke="(#\w+)" stroke-width', svg.decode()):
        for x, y in re.findall(r"[ML]([-\d.]+) ([-\d.]+)", path):
            across = place.position_mm[right] + (float(x) - cross_section.WIDTH / 2) * mm_per_point
            upward = place.position_mm[up] - (float(y) - cross_section.HEIGHT / 2) * mm_per_point
            radii[pen == "#000"].append(float(np.hypot(across, upward)))
    assert radii[True] == pytest.approx([10.0] * len(radii[True]), abs=0.02)
    assert radii[False] == pytest.approx([10.0 + factor * depth_mm] * len(radii[False]), abs=0.03)
    assert min(map(len, radii.values())) > 5


def test_a_cloud_has_a_section_of_its_points() -> None:
    design = icosphere(10.0, 4)
    cloud = Mesh(icosphere(10.05, 5).vertices, np.zeros((0, 3), dtype=np.int32))
    at = Place(cloud.vertices[0], 0.05)
    _, svg = cross_section.draw(at, design, cloud, np.full(len(cloud.vertices), 0.05), ColourScale(1.0, None))
    assert svg.count(b"<circle") > 5
