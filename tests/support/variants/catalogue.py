"""The lists of variants: of formula parts, and of any pair of meshes."""

from collections.abc import Callable, Iterator, Mapping
from typing import Protocol

from pipeline.core.mesh import Mesh
from tests.support.variants import changes
from tests.support.variants.bearing_block import BearingBlock
from tests.support.variants.bolt import Bolt
from tests.support.variants.bracket import Bracket
from tests.support.variants.cover import Cover
from tests.support.variants.crown import Crown
from tests.support.variants.plate import Plate
from tests.support.variants.record import (
    Variant,
    global_variant,
    local_variant,
    mirrored_variant,
    other_shape_variant,
)


class FormulaPart(Protocol):
    """A part by formula: `mesh` closed, and `changes` of single features, by name."""

    def mesh(self) -> Mesh: ...

    def changes(self) -> "Mapping[str, FormulaPart]": ...


FAMILIES: dict[str, Callable[[int], FormulaPart]] = {
    "bracket": Bracket.sampled,
    "cover": Cover.sampled,
    "plate": Plate.sampled,
    "bolt": Bolt.sampled,
    "bearing block": BearingBlock.sampled,
    "crown": Crown.sampled,
}
#: Sets of dimensions of each family; another seed than these works as well.
SEEDS = (0, 1, 2)
#: Elongations: one that a quality check must see, and one that the noise of a usual scan hides.
LONGER_SHARES = (0.04, 0.002)
#: The axis whose reversal changes a family least. A bolt is its own mirror image: it has none.
MIRROR_AXIS = {"bracket": 1, "cover": 1, "plate": 1, "bearing block": 0, "crown": 1}


def feature_variants(family: str, seed: int) -> Iterator[Variant]:
    """One feature changed: hole moved or filled, rib or boss missing; a second body missing, or one more."""
    part = FAMILIES[family](seed)
    design, name = part.mesh(), f"{family} {seed}"
    for change, changed in part.changes().items():
        yield local_variant(f"{name}, {change}", design, changed.mesh())
    pair = changes.with_pin(design)
    yield local_variant(f"{name}, second body missing", pair, design)
    yield local_variant(f"{name}, extra body", design, pair)


def shape_variants(family: str, seed: int) -> Iterator[Variant]:
    """Changed everywhere: longer along one axis, mirror image, next size of a bolt, another tooth."""
    design, name = FAMILIES[family](seed).mesh(), f"{family} {seed}"
    for share in LONGER_SHARES:
        yield longer(name, design, share)
    if family in MIRROR_AXIS:
        yield mirror(name, design, MIRROR_AXIS[family])
    if family == "bolt":
        yield global_variant(f"{name}, next size", design, Bolt.sampled(seed).next_size().mesh())
    if family == "crown":
        other = FAMILIES[family](seed + 1).mesh()
        yield other_shape(f"{name}, another tooth", design, other)


def stranger_variants(family: str, seed: int) -> Iterator[Variant]:
    """Every other family, scaled to the size of the design."""
    design = FAMILIES[family](seed).mesh()
    for other, sampled in FAMILIES.items():
        if other != family:
            yield other_shape(f"{family} {seed}, {other} of its size", design, sampled(seed).mesh())


def variants(seeds: tuple[int, ...] = SEEDS) -> Iterator[Variant]:
    """All of them, each made when it is asked for."""
    for seed in seeds:
        for family in FAMILIES:
            yield from feature_variants(family, seed)
            yield from shape_variants(family, seed)
            yield from stranger_variants(family, seed)


def longer(name: str, design: Mesh, share: float, axis: int | None = None) -> Variant:
    """Any mesh, longer by `share` along `axis`, by default its longest."""
    axis = changes.longest_axis(design) if axis is None else axis
    part = changes.stretched(design, axis, share)
    return global_variant(f"{name}, {100 * share:.1f} % longer", design, part)


def mirror(name: str, design: Mesh, axis: int) -> Variant:
    """Any mesh, as its mirror image."""
    return mirrored_variant(f"{name}, mirror image", design, changes.mirror_image(design, axis))


def other_shape(name: str, design: Mesh, other: Mesh) -> Variant:
    """Any two meshes: the other one scaled to the diagonal of the design."""
    return other_shape_variant(name, design, changes.scaled_to(other, design.diagonal_mm))
