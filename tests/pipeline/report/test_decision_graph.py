"""The decision graph is the same picture every time, with one disc a centre and numbers that can be read."""

import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from pipeline.core.settings import SegmentationSettings
from pipeline.report import decision_graph, palette
from pipeline.stages.segmentation import Segmentation

SVG = "{http://www.w3.org/2000/svg}"


def peaks(count: int, n: int = 400) -> Segmentation:
    rng = np.random.default_rng(0)
    rho, delta = rng.uniform(20, 90, n), rng.lognormal(0, 0.4, n)
    rho[:count], delta[:count] = 100.0, 20.0  # all centres in one place: the hardest case for their numbers
    labels = (np.arange(n) % count).astype(np.int32)
    return Segmentation(labels, rho < 50, rho, delta, np.arange(count, dtype=np.int64), 3.0)


def texts(path: Path) -> list[str]:
    """What a drawing says; fails if it is no XML."""
    drawing = ElementTree.parse(path)  # noqa: S314 - our own file
    return ["".join(each.itertext()) for each in drawing.iter(f"{SVG}text")]


@pytest.mark.parametrize("count", [1, 12])
def test_one_disc_a_centre_and_the_same_bytes_twice(count: int, tmp_path: Path) -> None:
    for name in ("once.svg", "again.svg"):
        decision_graph.write(tmp_path / name, "mesh", peaks(count), SegmentationSettings())
    once = (tmp_path / "once.svg").read_bytes()
    assert once == (tmp_path / "again.svg").read_bytes()
    discs = re.findall(r'id="centre-(\d+)"', once.decode())
    assert sorted(map(int, discs)) == list(range(count))


def test_axes_and_title_say_what_is_drawn_and_in_which_unit(tmp_path: Path) -> None:
    chart = decision_graph.draw("design", peaks(2), SegmentationSettings(method="kmedians"))
    chart.write(tmp_path / "graph.svg")
    words = " ".join(texts(tmp_path / "graph.svg"))
    assert "Decision graph of design: 2 segments by K-medians" in words
    assert "[mm²]" in words and "[mm]" in words
    assert (chart.x.log, chart.y.log) == (False, True)


def test_a_piece_of_one_vertex_has_a_place_on_the_log_axis(tmp_path: Path) -> None:
    graph = peaks(2)
    graph.delta[5] = 0.0
    decision_graph.write(tmp_path / "graph.svg", "mesh", graph, SegmentationSettings())
    drawn = (tmp_path / "graph.svg").read_text()
    assert drawn.endswith("</svg>\n") and "nan" not in drawn and "inf" not in drawn


def test_numbers_of_twelve_discs_in_one_place_do_not_cover_each_other() -> None:
    offsets = decision_graph.label_offsets(np.zeros((12, 2)))
    apart = np.abs(offsets[:, None] - offsets) >= decision_graph.LABEL_PT
    np.testing.assert_array_equal(apart.any(axis=2), ~np.eye(12, dtype=np.bool_))


def test_colours_repeat_after_nine_segments_and_halo_is_paler() -> None:
    labels, halo = np.array([0, 9, 0], dtype=np.int32), np.array([False, False, True])
    core, same, pale = palette.of_vertices(labels, halo)
    np.testing.assert_array_equal(core, same)
    assert np.abs(pale - palette.PALE).max() < np.abs(core - palette.PALE).max()
    np.testing.assert_array_equal(palette.of_segment(10), palette.PALETTE[1])
