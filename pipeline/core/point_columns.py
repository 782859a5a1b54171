"""What a person states about the columns of a point text, where the text alone can be read in two ways."""

import re
from dataclasses import dataclass

#: Words for delimiters, as in `delimiter=semicolon`.
DELIMITERS = {"space": " ", "tab": "\t", "comma": ",", "semicolon": ";", "pipe": "|"}
DECIMALS = {"point": ".", "comma": ","}
FORM = (
    "write the name of each column in order (id,x,y,z), or the numbers of those of x, y and z, from 1 "
    "(2,3,4); where needed then decimal=comma or decimal=point, and delimiter=space, tab, comma, semicolon "
    "or pipe"
)
_MAX_CHARACTERS = 2000


@dataclass(frozen=True, slots=True)
class PointColumns:
    """columns : of x, y and z, from 0; n_columns : of each row, None where any number may follow; delimiter,
    decimal : characters, None where they are found from the text (a space is any white space)
    """

    columns: tuple[int, int, int]
    n_columns: int | None
    delimiter: str | None = None
    decimal: str | None = None

    @classmethod
    def of(cls, stated: str) -> "PointColumns":
        """Read `id,x,y,z` or `2,3,4 decimal=comma delimiter=semicolon`.

        Raises
        ------
        ValueError
            With what is wrong, and how it is written.
        """
        words = [word for word in re.split(r"[\s,;]+", stated[:_MAX_CHARACTERS].strip().lower()) if word]
        names = [word for word in words if "=" not in word]
        keys = dict(word.split("=", 1) for word in words if "=" in word)
        for key, value in keys.items():
            known = {"delimiter": DELIMITERS, "decimal": DECIMALS}.get(key, {})
            if value not in known:
                raise ValueError(f"{key}={value} is not known; {FORM}")
        columns, n_columns = _places(names)
        return cls(
            columns,
            n_columns,
            DELIMITERS.get(keys.get("delimiter", "")),
            DECIMALS.get(keys.get("decimal", "")),
        )


def _places(names: list[str]) -> tuple[tuple[int, int, int], int | None]:
    if names and all(re.fullmatch(r"[1-9]\d{0,3}", name) for name in names):
        if len(set(names)) != 3 or len(names) != 3:
            raise ValueError(f"{len(names)} numbers of columns, but x, y and z are three; {FORM}")
        x, y, z = (int(name) - 1 for name in names)
        return (x, y, z), None
    for axis in "xyz":
        if names.count(axis) != 1:
            raise ValueError(f"{names.count(axis)} columns are named {axis}, not one; {FORM}")
    return (names.index("x"), names.index("y"), names.index("z")), len(names)
