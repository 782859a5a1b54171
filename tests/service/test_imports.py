"""The API process stays small: it never loads the libraries that compute."""

import subprocess
import sys

HEAVY = (
    "open3d",
    "pymeshlab",
    "trimesh",
    "scipy",
    "matplotlib",
    "numpy",
    "dbos",
    "alembic",
    "typer",
    "httpx",
)


def test_the_api_imports_no_library_that_computes() -> None:
    program = (
        "import sys, service.cli.part, service.api.server, service.api.app, service.settings as s;"
        "service.api.app.create_app(s.ServiceSettings.model_construct());"
        f"print([name for name in {HEAVY!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
