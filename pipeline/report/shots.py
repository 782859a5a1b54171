"""Pictures of a part with what makes them readable: a scale bar, and pins with labels that do not overlap."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import raster
from pipeline.report.render import Framing, Rendered, png, rendered
from pipeline.report.views import named_view

#: Width and height of a view, and of one of those that stand four in a row.
PICTURE_PX, SMALL_PX = (520, 380), (364, 266)
#: Strip below the part for the scale bar, pixels.
FOOT_PX = 30
#: Longest scale bar, and height of a label and its letters, pixels. Chosen by hand.
BAR_PX, LINE_PX, LETTER_PX = 130.0, 28.0, 9.8
#: A pin is hidden where a surface lies in front of it by more than this share of the width of the picture.
HIDDEN_SHARE = 0.01


@dataclass(frozen=True, slots=True)
class Pin:
    """A place on the part with its words. position_mm : (3,) in the frame of the picture"""

    words: str
    position_mm: FloatArray


@dataclass(frozen=True, slots=True)
class Label:
    """A pin in a picture, pixels. x, y : of the place; left, top, wide : of the plate with the words"""

    words: str
    x: float
    y: float
    left: float
    top: float
    wide: float
    is_hidden: bool

    @property
    def end(self) -> float:
        """Where the line from the place meets the plate."""
        return self.left + self.wide if self.left < self.x else self.left


@dataclass(frozen=True, slots=True)
class Shot:
    """caption; data : PNG; bar_px, bar_words : of the scale bar; labels : of the pins"""

    caption: str
    data: bytes
    bar_px: float
    bar_words: str
    labels: Sequence[Label]
    width: int
    height: int


def shoot(
    mesh: Mesh,
    colours: FloatArray,
    like: Mesh,
    names: Sequence[str],
    *,
    caption: Callable[[str], str] = str,
    landmarks_mm: FloatArray | None = None,
    pins: Sequence[Pin] = (),
    fronts: int = 0,
    size_px: tuple[int, int] = PICTURE_PX,
) -> list[Shot]:
    """The named views, with both meshes inside each picture.

    colours : (n, 3) in [0, 1] of the vertices of `mesh`; like : a mesh in the same frame; caption : of the
    name of a view; landmarks_mm : (m, 3), drawn as dots; fronts : as of `rendered`
    """

    def shot(name: str) -> Shot:
        return finished(
            caption(name), render_view(mesh, colours, like, name, landmarks_mm, fronts, size_px), pins
        )

    # The kernel that draws and the compression both work without the interpreter's lock.
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as threads:
        return list(threads.map(shot, names))


def render_view(
    mesh: Mesh,
    colours: FloatArray,
    like: Mesh,
    name: str,
    landmarks_mm: FloatArray | None = None,
    fronts: int = 0,
    size_px: tuple[int, int] = PICTURE_PX,
) -> Rendered:
    """One view; a cloud of points lies on `like`. See `shoot`."""
    frame = like.vertices if mesh is like else np.concatenate([like.vertices, mesh.vertices])
    framing = Framing.of(named_view(name), frame, *size_px, foot=FOOT_PX)
    under = like if mesh.is_cloud and not like.is_cloud else None
    return rendered(mesh, colours, framing, landmarks_mm=landmarks_mm, fronts=fronts, under=under)


def finished(caption: str, view: Rendered, pins: Sequence[Pin]) -> Shot:
    """The picture of a view with its scale bar and pins."""
    mm_per_px = view.framing.mm_per_px
    length_mm = round_below(BAR_PX * mm_per_px)
    bar = (length_mm / mm_per_px, f"{length_mm:g} mm")
    labels, (width, height) = labels_of(view, pins), (view.framing.width, view.framing.height)
    return Shot(caption, png(view.image), *bar, labels, width, height)


def round_below(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is no larger than `value` > 0."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(max(step * power for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))


def is_seen(mesh: Mesh, name: str, position_mm: FloatArray) -> bool:
    """Whether the named view shows a place: no triangle of the mesh lies in front of it."""
    axes, step = named_view(name).axes, HIDDEN_SHARE * mesh.diagonal_mm / 4
    x, y, height = axes @ position_mm
    white = np.ones((len(mesh.vertices), 3))
    _, depth = raster.draw(
        *(mesh.vertices @ axes.T, mesh.faces, white),
        left=float(x),
        top=float(y),
        step=step,
        size_px=(1, 1),
        ambient=1.0,
        background=1.0,
    )
    return bool(depth[0, 0] <= height + 4 * step)


def slack_mm(view: Rendered) -> float:
    return HIDDEN_SHARE * view.framing.width * view.framing.mm_per_px


def labels_of(view: Rendered, pins: Sequence[Pin]) -> list[Label]:
    """Plates in two columns at the edges, in the order of their places, at least a line apart."""
    places = [(pin, *view.framing.pixel(pin.position_mm)[:2]) for pin in pins]
    width, height = view.framing.width, view.framing.height
    found = []
    for is_left in (True, False):
        column = sorted(
            (place for place in places if (place[1] < width / 2) is is_left), key=lambda place: place[2]
        )
        tops = spread([y for _, _, y in column], 4.0 + LINE_PX / 2, height - 46.0)
        for (pin, x, y), top in zip(column, tops, strict=True):
            wide = LETTER_PX * len(pin.words) + 12
            left = 6.0 if is_left else width - wide - 6.0
            is_hidden = not view.shows(pin.position_mm, slack_mm(view))
            found.append(Label(pin.words, x, y, left, top - LINE_PX / 2, wide, is_hidden))
    return found


def spread(wanted: Sequence[float], first: float, last: float) -> list[float]:
    """Heights near the wanted ones (ascending), at least a line apart, between the ends if they fit."""
    found: list[float] = []
    for y in wanted:
        found.append(max(y, first, found[-1] + LINE_PX if found else first))
    end = last
    for k in range(len(found) - 1, -1, -1):
        found[k] = min(found[k], end)
        end = found[k] - LINE_PX
    return found
