"""Write openapi/examples/results.<type>.json: real results of small jobs, run here with the default settings.

    .venv/bin/python -m tests.support.example_results

Run it again when the records of the pipeline change; `cusp openapi` leaves these files alone.
"""

import tempfile
from pathlib import Path

import pipeline
from tests.support.meshes import blob_stl

EXAMPLES = Path(__file__).parents[2] / "openapi" / "examples"


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        design, scan, out = (Path(folder) / name for name in ("design.stl", "scan.stl", "out"))
        design.write_bytes(blob_stl())
        scan.write_bytes(blob_stl(26, 34, turn_deg=35.0, shift_mm=(12.0, -7.0, 3.0)))
        turned = pipeline.Settings(study=pipeline.StudySettings(rotation_deg=45.0))
        results = (
            pipeline.register(
                design,
                scan,
                tolerance_mm=0.2,
                acceptance=pipeline.Acceptance(min_within=0.9, max_deviation_mm=0.5, min_coverage=0.9),
                reference=pipeline.Reference(part_number="BLOB-1", serial="0042"),
                out=out / "registration",
            ),
            pipeline.find_landmarks(design, out=out / "landmarks"),
            pipeline.study(
                design, settings=turned, trials=100, detectors=("t2", "iss", "random"), out=out / "study"
            ),
        )
    for result in results:
        (EXAMPLES / f"results.{result.type}.json").write_text(result.model_dump_json(indent=1) + "\n")


if __name__ == "__main__":
    main()
