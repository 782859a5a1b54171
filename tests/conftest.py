"""Where the real meshes are, for the tests marked `data`."""

import os
from pathlib import Path

import pytest


def data_folder() -> Path | None:
    """`CUSP_DATA`, or the shared folder beside a developer's checkout when it exists."""
    beside = Path(__file__).parents[2] / "shared" / "data"
    given = os.environ.get("CUSP_DATA")
    folder = Path(given) if given else beside
    return folder if folder.is_dir() else None


@pytest.fixture(scope="session")
def data() -> Path:
    folder = data_folder()
    if folder is None:
        pytest.skip("set CUSP_DATA to the folder of real meshes")
    return folder
