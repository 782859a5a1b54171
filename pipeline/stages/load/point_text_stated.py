"""The rows of a point text in the columns that a person states."""

from pipeline.core.point_columns import PointColumns
from pipeline.stages.load.point_text_fields import Shape
from pipeline.stages.load.point_text_heading import Heading


def stated_shapes(
    line: bytes, delimiter: str, shapes: list[tuple[Shape, Heading | None]], stated: PointColumns
) -> list[tuple[Shape, Heading | None]]:
    """The shapes by a delimiter that have the stated columns, with those as heading, in the unit of the text.

    line : the first row
    """
    if stated.delimiter not in (None, delimiter):
        return []
    n = len(line.split()) if delimiter == " " else line.count(delimiter.encode()) + 1
    unit = next((heading.unit for _, heading in shapes if heading is not None), None)
    trailing = any(shape.trailing for shape, _ in shapes)
    found: list[tuple[Shape, Heading | None]] = []
    for width, pairs in ((n - trailing, False), (n // 2, delimiter == "," and n % 2 == 0)):
        fits = width == stated.n_columns or (stated.n_columns is None and width > max(stated.columns))
        by_decimal = not pairs if stated.decimal == "." else pairs or delimiter != ","
        if fits and (stated.decimal is None or by_decimal):
            shape = Shape(delimiter, width, trailing and not pairs, pairs)
            found.append((shape, Heading(stated.columns, (), unit)))
    return found
