"""How often is a pose right that says it is? `python -m tests.accuracy.confidence --out FILE`, then `--fit
FILE`

Cases that the gauntlet does not have, harder than its own (other seeds, pieces down to 15 %, noise up to 1 %,
warp up to 2 %), are registered, and the best pose of each is right or wrong whatever the verdict would be. A
logistic regression of that on `verification.evidence` is fitted on half of the shapes and judged on the other
half; what is printed last, fitted on all of them, stands in `pipeline/verification/thresholds.py`. `--judge
FILE` is for the lines of `tests.accuracy.gauntlet`: cases that had no part in it.
"""

import argparse
import itertools
import json
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from sklearn.linear_model import LogisticRegression

import pipeline
from pipeline import MeshFile
from pipeline.analysis.inputs import read_mesh
from pipeline.analysis.mesh_analysis import analyse_mesh
from pipeline.analysis.scan_registration import match_scan, register_scan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import Settings
from pipeline.core.timing import silent
from pipeline.verification.alternative_hypotheses import verify_hypotheses
from pipeline.verification.evidence import Case, evidence, probability
from pipeline.verification.verdict import judge
from tests.accuracy import gauntlet_cases, gauntlet_error, gauntlet_rows, gauntlet_specs
from tests.accuracy.bench import save
from tests.accuracy.gauntlet_specs import Condition, Spec
from tests.support.designs import design_of

FIRST_SEED = 1000  # the gauntlet's are 0, 1, 2 ...
HARDER = {
    "crop 70 %": Condition(crop=0.70),
    "crop 85 %": Condition(crop=0.85),
    "rough crop 55 %": Condition(0.003, 0.01, 0.55),
    "very rough": Condition(0.01, 0.02),
    "very rough crop 70 %": Condition(0.01, 0.02, 0.70),
}
BINS = (0.0, 0.2, 0.5, 0.8, 0.9, 0.95, 0.99, 1.0)


def specs(seeds: int) -> list[Spec]:
    """Of every shape all conditions once, spread over the seeds; poses that are right and poses that
    cannot be.
    """
    found = []
    shapes = ("formula/demo arch", "formula/blob", *gauntlet_specs.UNIQUE, *gauntlet_specs.NEARLY_SYMMETRIC)
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for condition in ("scan", *HARDER):
            found += [Spec("harder", shape, condition, seed) for shape in shapes]
        found += [
            Spec("other part", design, "scan", seed, scanned) for design, scanned in gauntlet_specs.STRANGERS
        ]
        found += [
            Spec("another patient", design, "scan", seed, scan) for design, scan in gauntlet_specs.PATIENTS
        ]
        found += [Spec("depth camera", f"pairs/{pair}", "points", seed) for pair in gauntlet_specs.PAIRS]
    return found


def measured(spec: Spec) -> dict[str, Any]:
    """One case: the evidence for its best pose, and whether that is right."""
    gauntlet_specs.CONDITIONS.update(HARDER)
    case = gauntlet_cases.build(spec)
    settings = Settings()
    with tempfile.TemporaryDirectory() as folder:
        files = [
            save(mesh, Path(folder) / f"{name}.ply") for name, mesh in (("d", case.design), ("s", case.scan))
        ]
        design_in, scan_in = (
            read_mesh(MeshFile(path), name, settings, silent(), needs_surface=name == "design")
            for path, name in zip(files, ("design", "scan"), strict=True)
        )
    design, job = design_of(design_in.mesh, settings), JobParameters(settings, 0, None)
    scan = analyse_mesh(scan_in.mesh, "scan", design.scales, settings, silent(), 0)
    registered = register_scan(match_scan(scan, design, job), design, job)
    registered, checks = verify_hypotheses(registered, design, job)
    judged = Case.of(registered, checks, design, job)
    error = gauntlet_error.error(replace(case, unit_factor=1.0), registered.registration.best.T_design_scan)
    right = error is not None and error.right and not error.at_rival
    return {
        "case": spec.name,
        "shape": spec.shape,
        "right": right,
        "status": judge(judged, settings.registration).status,
        "evidence": evidence(judged, settings.registration).tolist(),
    }


def rows_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def run(todo: list[Spec], path: Path, processes: int) -> None:
    done = {row["case"] for row in rows_of(path)} if path.exists() else set()
    todo = [spec for spec in todo if spec.name not in done]
    with (
        path.open("a", encoding="utf-8") as out,
        ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=pipeline.preload) as pool,
    ):
        for number, row in enumerate(_results(pool, todo)):
            out.write(json.dumps(row) + "\n")
            out.flush()
            print(
                f"{number + 1} of {len(todo)}: {row['case']}: {row['status']}, "
                f"{'right' if row['right'] else 'wrong'}"
            )


def _results(pool: ProcessPoolExecutor, todo: list[Spec]) -> Iterator[dict[str, Any]]:
    running = [pool.submit(measured, spec) for spec in todo]
    for spec, future in zip(todo, running, strict=True):
        try:
            yield future.result()
        except pipeline.PipelineError as refused:  # a piece too small to be meshed has no pose to judge
            print(f"{spec.name}: {refused}")


def fit(rows: list[dict[str, Any]]) -> FloatArray:
    """(k + 1,) intercept, then a weight for each piece of evidence."""
    model = LogisticRegression(C=1.0, max_iter=1000).fit(
        [row["evidence"] for row in rows], [row["right"] for row in rows]
    )
    return np.concatenate([model.intercept_, model.coef_[0]])


def judged_table(said: FloatArray, right: FloatArray, title: str) -> Table:
    """Reliability: of the poses that say so much, how many are right. Brier score in the title."""
    brier = float(np.mean((said - right) ** 2))
    made = Table(
        "confidence",
        "cases",
        "mean said",
        "right",
        title=f"{title}: {len(said)} cases, Brier score {brier:.4f}",
    )
    for low, high in itertools.pairwise(BINS):
        chosen = (said >= low) & ((said < high) | (high == 1.0))
        if chosen.any():
            made.add_row(
                f"{low} to {high}",
                str(chosen.sum()),
                f"{said[chosen].mean():.3f}",
                f"{right[chosen].mean():.3f}",
            )
    return made


def _by_shape(rows: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    shapes = sorted({row["shape"] for row in rows})
    first = set(shapes[::2])
    return [row for row in rows if row["shape"] in first], [row for row in rows if row["shape"] not in first]


def _said(weights: FloatArray, rows: list[dict[str, Any]]) -> FloatArray:
    return np.array([probability(weights, np.array(row["evidence"])) for row in rows])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path)
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--fit", type=Path)
    parser.add_argument("--judge", type=Path)
    args = parser.parse_args()
    console = Console(width=120)
    if args.out:
        run(specs(args.seeds), args.out, args.processes)
    if args.fit:
        rows = rows_of(args.fit)
        for learned, kept_out in (_by_shape(rows), _by_shape(rows)[::-1]):
            said = _said(fit(learned), kept_out)
            right = np.array([row["right"] for row in kept_out], dtype=np.float64)
            console.print(judged_table(said, right, f"{len(learned)} cases learned, other shapes judged"))
        console.print("all cases:", np.round(fit(rows), 2).tolist())
    if args.judge:
        lines = [
            row
            for row in gauntlet_rows.read_rows(args.judge).values()
            if row.tool == gauntlet_rows.CUSP and row.confidence
        ]
        said = np.array([row.confidence for row in lines])
        right = np.array([bool(row.right) and not row.at_rival for row in lines], dtype=np.float64)
        console.print(judged_table(said, right, "poses given in the gauntlet"))


if __name__ == "__main__":
    main()
