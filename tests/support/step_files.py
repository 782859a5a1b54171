"""STEP files (ISO 10303-21) by formula: boxes and cylinders as solids or open shells, parts and assemblies,
in any unit. Written without a CAD program.
"""

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from pipeline.core.mesh import FloatArray

#: Entities of the length units, by the name of the unit; {metre}: number of the metre.
UNITS = {
    "mm": "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.) )",
    "cm": "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.CENTI.,.METRE.) )",
    "m": "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT($,.METRE.) )",
    "micron": "( LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MICRO.,.METRE.) )",
}
#: Conversion-based units: name in the file, millimetres.
CONVERTED = {"inch": ("INCH", 25.4), "foot": ("FOOT", 304.8)}
SCHEMAS = {
    "AP203": "CONFIG_CONTROL_DESIGN",
    "AP214": "AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }",
    "AP242": "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }",
}
X, Y, Z = np.eye(3)


@dataclass
class Step:
    """One file in the making. Shapes return the number of their representation item."""

    unit: str = "mm"
    schema: str = "AP214"
    lines: list[str] = field(default_factory=list)
    products: list[tuple[int, int]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.application = self.add("APPLICATION_CONTEXT('mechanical design')")
        self.add(
            f"APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,"
            f"#{self.application})"
        )
        if self.unit in CONVERTED:
            name, mm = CONVERTED[self.unit]
            base = self.add(UNITS["mm"])
            measure = self.add(f"LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({mm}),#{base})")
            dimensions = self.add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)")
            length = self.add(
                f"( CONVERSION_BASED_UNIT('{name}',#{measure}) LENGTH_UNIT() NAMED_UNIT(#{dimensions}) )"
            )
        else:
            length = self.add(UNITS[self.unit])
        angle = self.add("( NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.) )")
        solid = self.add("( NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT() )")
        uncertainty = self.add(
            f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),#{length},'distance_accuracy_value','')"
        )
        self.context = self.add(
            "( GEOMETRIC_REPRESENTATION_CONTEXT(3) "
            f"GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{uncertainty})) "
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{solid})) REPRESENTATION_CONTEXT('','') )"
        )

    def add(self, entity: str) -> int:
        self.lines.append(entity)
        return len(self.lines)

    def text(self) -> bytes:
        data = "\n".join(f"#{number}={entity};" for number, entity in enumerate(self.lines, start=1))
        return (
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n"
            "FILE_NAME('part.step','2026-01-01T00:00:00',(''),(''),'','','');\n"
            f"FILE_SCHEMA(('{SCHEMAS[self.schema]}'));\nENDSEC;\nDATA;\n{data}\nENDSEC;\nEND-ISO-10303-21;\n"
        ).encode()

    # geometry

    def point(self, at: FloatArray) -> int:
        return self.add(f"CARTESIAN_POINT('',({_reals(at)}))")

    def direction(self, along: FloatArray) -> int:
        return self.add(f"DIRECTION('',({_reals(along)}))")

    def axes(self, at: FloatArray, z: FloatArray = Z, x: FloatArray = X) -> int:
        return self.add(f"AXIS2_PLACEMENT_3D('',#{self.point(at)},#{self.direction(z)},#{self.direction(x)})")

    def vertex(self, at: FloatArray) -> int:
        return self.add(f"VERTEX_POINT('',#{self.point(at)})")

    def line(self, start: FloatArray, end: FloatArray) -> int:
        length = float(np.linalg.norm(end - start))
        vector = self.add(f"VECTOR('',#{self.direction((end - start) / length)},1.)")
        return self.add(f"LINE('',#{self.point(start)},#{vector})")

    def edge(self, start: int, end: int, curve: int) -> int:
        return self.add(f"EDGE_CURVE('',#{start},#{end},#{curve},.T.)")

    def face(self, loop: list[tuple[int, bool]], surface: int, name: str = "") -> int:
        oriented = [self.add(f"ORIENTED_EDGE('',*,*,#{edge},{_flag(ahead)})") for edge, ahead in loop]
        ring = self.add(f"EDGE_LOOP('',({_refs(oriented)}))")
        bound = self.add(f"FACE_OUTER_BOUND('',#{ring},.T.)")
        return self.add(f"ADVANCED_FACE('{name}',(#{bound}),#{surface},.T.)")

    # shapes

    def box_faces(self, size: FloatArray, at: FloatArray | None = None) -> list[int]:
        """The six faces of a box of `size`, its least corner at `at`."""
        low = np.zeros(3) if at is None else np.asarray(at, dtype=float)
        corners = [low + np.asarray(size) * [n & 1, n >> 1 & 1, n >> 2] for n in range(8)]
        vertices = [self.vertex(corner) for corner in corners]
        edges: dict[tuple[int, int], int] = {}
        faces = []
        # seen from outside, counter-clockwise
        for ring in ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)):
            loop = []
            for a, b in pairwise((*ring, ring[0])):
                key = (min(a, b), max(a, b))
                if key not in edges:
                    line = self.line(corners[key[0]], corners[key[1]])
                    edges[key] = self.edge(vertices[key[0]], vertices[key[1]], line)
                loop.append((edges[key], a < b))
            first, second = corners[ring[1]] - corners[ring[0]], corners[ring[2]] - corners[ring[1]]
            normal = np.cross(first, second)
            axes = self.axes(corners[ring[0]], _unit(normal), _unit(first))
            faces.append(self.face(loop, self.add(f"PLANE('',#{axes})"), f"side {len(faces)}"))
        return faces

    def cylinder_faces(self, radius: float, height: float) -> list[int]:
        """Bottom, top and side of a cylinder around z, its bottom at z = 0."""
        low, high = np.zeros(3), height * Z
        start, end = self.vertex(low + radius * X), self.vertex(high + radius * X)
        rings = [self.add(f"CIRCLE('',#{self.axes(at)},{radius!r})") for at in (low, high)]
        bottom, top = self.edge(start, start, rings[0]), self.edge(end, end, rings[1])
        seam = self.edge(start, end, self.line(low + radius * X, high + radius * X))
        side = self.add(f"CYLINDRICAL_SURFACE('',#{self.axes(low)},{radius!r})")
        down = self.add(f"PLANE('',#{self.axes(low, -Z)})")
        up = self.add(f"PLANE('',#{self.axes(high)})")
        return [
            self.face([(bottom, False)], down, "bottom"),
            self.face([(top, True)], up, "top"),
            self.face([(bottom, True), (seam, True), (top, False), (seam, False)], side, "side"),
        ]

    def solid(self, faces: list[int], name: str = "") -> int:
        shell = self.add(f"CLOSED_SHELL('',({_refs(faces)}))")
        return self.add(f"MANIFOLD_SOLID_BREP('{name}',#{shell})")

    def hollow(self, faces: list[int], cavity: list[int], name: str = "hollow") -> int:
        """A solid with a cavity, whose faces look outwards by themselves."""
        outer, void = (self.add(f"CLOSED_SHELL('',({_refs(each)}))") for each in (faces, cavity))
        inward = self.add(f"ORIENTED_CLOSED_SHELL('',*,#{void},.F.)")
        return self.add(f"BREP_WITH_VOIDS('{name}',#{outer},(#{inward}))")

    def surface(self, faces: list[int]) -> int:
        """The faces as an open shell."""
        shell = self.add(f"OPEN_SHELL('',({_refs(faces)}))")
        return self.add(f"SHELL_BASED_SURFACE_MODEL('',(#{shell}))")

    # products

    def product(self, name: str, items: list[int], kind: str = "ADVANCED_BREP_SHAPE_REPRESENTATION") -> None:
        """A part with its shape. `products` keeps its definition and its representation."""
        context = self.add(f"PRODUCT_CONTEXT('',#{self.application},'mechanical')")
        product = self.add(f"PRODUCT('{name}','{name}','',(#{context}))")
        formation = self.add(f"PRODUCT_DEFINITION_FORMATION('','',#{product})")
        design = self.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',#{self.application},'design')")
        definition = self.add(f"PRODUCT_DEFINITION('design','',#{formation},#{design})")
        shape = self.add(f"PRODUCT_DEFINITION_SHAPE('','',#{definition})")
        placed = [self.axes(np.zeros(3)), *items]
        representation = self.add(f"{kind}('{name}',({_refs(placed)}),#{self.context})")
        self.add(f"SHAPE_DEFINITION_REPRESENTATION(#{shape},#{representation})")
        self.products.append((definition, representation))

    def assembly(self, name: str, placed: list[tuple[int, FloatArray]]) -> None:
        """Products, by their position in `products`, moved by the offsets."""
        self.product(name, [], "SHAPE_REPRESENTATION")
        parent, frame = self.products[-1]
        for number, (index, offset) in enumerate(placed):
            child, representation = self.products[index]
            usage = self.add(
                f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{number}','{name}.{number}','',#{parent},#{child},$)"
            )
            shape = self.add(f"PRODUCT_DEFINITION_SHAPE('','',#{usage})")
            motion = self.add(
                f"ITEM_DEFINED_TRANSFORMATION('','',#{self.axes(np.zeros(3))},#{self.axes(offset)})"
            )
            relation = self.add(
                f"( REPRESENTATION_RELATIONSHIP('','',#{representation},#{frame}) "
                f"REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION(#{motion}) "
                "SHAPE_REPRESENTATION_RELATIONSHIP() )"
            )
            self.add(f"CONTEXT_DEPENDENT_SHAPE_REPRESENTATION(#{relation},#{shape})")


def box(
    size: tuple[float, float, float] = (10.0, 20.0, 30.0), unit: str = "mm", schema: str = "AP214"
) -> bytes:
    """A box with its least corner at the origin."""
    step = Step(unit, schema)
    step.product("box", [step.solid(step.box_faces(np.array(size)), "block")])
    return step.text()


def cylinder(radius: float = 5.0, height: float = 20.0, unit: str = "mm") -> bytes:
    """A cylinder around z, its bottom at z = 0."""
    step = Step(unit)
    step.product("pin", [step.solid(step.cylinder_faces(radius, height))])
    return step.text()


def _unit(vector: FloatArray) -> FloatArray:
    result: FloatArray = vector / np.linalg.norm(vector)
    return result


def _reals(values: FloatArray) -> str:
    return ",".join(repr(float(value) + 0.0) for value in values)


def _refs(numbers: list[int]) -> str:
    return ",".join(f"#{number}" for number in numbers)


def _flag(value: bool) -> str:
    return ".T." if value else ".F."
