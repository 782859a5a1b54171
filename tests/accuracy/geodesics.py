"""Are the exact distances right, and how much faster than the libraries? `make bench` prints the tables.

(a) Side by side in one run with pygeodesic (exact), libigl (exact, when it can be imported) and potpourri3d
(heat method): one full source, then everything of CFSFDP against all pairs. (b) Growth with n at about 100
neighbours inside d_c.

Wall and CPU seconds of medians; ours runs in all threads, a single source and every other library in one.
"All pairs" is n times the median source of SOURCES evenly spread ones, and excludes sorting the pairs, which
the all-pairs route also has to do.
"""

import json
import sys

from rich.console import Console

from tests.accuracy.geodesics_growth import grow, growth
from tests.accuracy.geodesics_peers import side_by_side


def main() -> None:
    if sys.argv[1:2] == ["grow"]:
        print(json.dumps(grow(int(sys.argv[2]))))
        return
    console = Console(width=190)
    growth(console)
    side_by_side(console)


if __name__ == "__main__":
    main()
