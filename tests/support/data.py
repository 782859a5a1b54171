"""Where the real meshes are, for the tests marked `data`."""

import os
from pathlib import Path


def data_folder() -> Path | None:
    """`CUSP_DATA`, or the shared folder beside a developer's checkout when it exists."""
    beside = Path(__file__).parents[3] / "shared" / "data"
    given = os.environ.get("CUSP_DATA")
    folder = Path(given) if given else beside
    return folder if folder.is_dir() else None
