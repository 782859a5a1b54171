"""The tables of the README are what the code says."""

import json
from pathlib import Path

from pipeline import PipelineError
from pipeline.core.settings import Settings
from service.contract.errors import TABLE
from service.settings import ServiceSettings

README = (Path(__file__).parents[1] / "README.md").read_text()


def test_every_setting_of_the_method_stands_with_its_default() -> None:
    for section, field in Settings.model_fields.items():
        for name, knob in type(field.default).model_fields.items():
            default = json.dumps(knob.default).strip('"')
            assert f"| `{section}.{name}` | `{default}` | {knob.description} |" in README


def test_every_setting_of_the_service_stands_with_its_meaning() -> None:
    for name, knob in ServiceSettings.model_fields.items():
        line = next(
            (line for line in README.splitlines() if line.startswith(f"| `CUSP_{name.upper()}` |")), ""
        )
        assert knob.description in line


def test_every_error_code_stands_with_its_status() -> None:
    rows = [line.split("|") for line in README.splitlines() if line.startswith("| ") and line[2:5].isdigit()]
    printed = {int(row[1]): set(row[2].split("(")[0].replace("`", "").split()) for row in rows}
    told: dict[int, set[str]] = {}
    for error, row in TABLE.items():
        if error is not PipelineError:  # the base is never raised itself
            told.setdefault(row.status, set()).add(str(vars(error)["code"]))
    assert printed == told
