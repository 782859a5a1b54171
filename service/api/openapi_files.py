"""The folder `openapi/`: openapi.json and one example of every document, as `cusp openapi` writes them."""

import json
from pathlib import Path
from typing import Any

from service.api.app import create_app
from service.api.examples import examples
from service.settings import ServiceSettings


def write(folder: Path) -> None:
    """Write openapi.json and examples/*.json, and delete examples that no longer exist."""
    target = folder / "examples"
    target.mkdir(parents=True, exist_ok=True)
    (folder / "openapi.json").write_text(as_text(create_app(ServiceSettings.model_construct()).openapi()))
    wanted = examples()
    for path in target.glob("*.json"):
        if path.name not in wanted and not path.name.startswith("results."):  # those are results of real jobs
            path.unlink()
    for name, content in wanted.items():
        (target / name).write_text(as_text(content))


def as_text(content: Any) -> str:
    """JSON as it is committed: indented, with a line break at its end."""
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"
