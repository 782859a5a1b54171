"""How often is a pose right that says it is? `python -m tests.accuracy.confidence --out FILE`, then `--fit
FILE`

Cases that the gauntlet does not have, harder than its own (other seeds, pieces down to 15 %, noise up to 1 %,
warp up to 2 %, simulated scanners, other parts under every scanner), are registered. Of each, the evidence is
kept, and two truths: whether the scan is of the design, and whether the best pose is right, whatever the
verdict would be. Two logistic regressions are fitted on half of the shapes and judged on the other half; what
is printed last, fitted on all of them, stands in `pipeline/verification/thresholds.py`. `--judge FILE` is for
the lines of `tests.accuracy.gauntlet`: cases that had no part in it.
"""

import argparse
import hashlib
import json
import os
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from sklearn.linear_model import LogisticRegression

import pipeline
from pipeline.core.mesh import FloatArray
from pipeline.verification.evidence import probability
from pipeline.verification.thresholds import CONFIDENCE, LogisticModel
from tests.accuracy import (
    gauntlet_cases,
    gauntlet_error,
    gauntlet_rows,
    gauntlet_scanners,
    gauntlet_specs,
)
from tests.accuracy.bench import save
from tests.accuracy.gauntlet_specs import Condition, Spec
from tests.accuracy.gauntlet_tables import reliability

ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
FIRST_SEED = 1000  # the gauntlet's are 0, 1, 2 ...
#: Inverse strength of the regularisation of the fits. Chosen on the halves: at 1 the probabilities stay too
#: near 0.5, at 100 a weight turns against its meaning.
REGULARISATION = 10.0
HARDER = {
    "crop 70 %": Condition(crop=0.70),
    "crop 85 %": Condition(crop=0.85),
    "rough crop 55 %": Condition(0.003, 0.01, 0.55),
    "very rough": Condition(0.01, 0.02),
    "very rough crop 70 %": Condition(0.01, 0.02, 0.70),
}


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
        found += [
            spec for spec in gauntlet_scanners.scanner_specs(seed) if spec.group in gauntlet_scanners.FITTED
        ]
        rng = np.random.default_rng(seed)
        for design in shapes:  # one part under a camera, by chance, for each design
            scanned = shapes[int(rng.integers(len(shapes)))]
            if scanned != design:
                found += [
                    Spec(gauntlet_scanners.OTHER_CAMERA, design, condition, seed, scanned)
                    for condition in ("camera 1 %", "camera 1 %, stated")
                ]
    return found


def measured(spec: Spec, kept: Path) -> dict[str, Any]:
    """One case: the evidence for its best pose, and what is true of it. kept : folder of analysed designs"""
    gauntlet_specs.CONDITIONS.update(HARDER)
    case = gauntlet_cases.build(spec)
    with tempfile.TemporaryDirectory() as folder:
        design, scan = (
            save(mesh, Path(folder) / f"{name}.ply") for name, mesh in (("d", case.design), ("s", case.scan))
        )
        cache = kept / f"{hashlib.sha256(design.read_bytes()).hexdigest()}.npz"
        result = pipeline.register(design, scan, scan_accuracy_mm=case.scan_accuracy_mm, design_cache=cache)
    best = result.alternatives[0] if result.transform is None else result.transform
    error = gauntlet_error.error(replace(case, unit_factor=1.0), np.array(best.matrix))
    return {
        "case": spec.name,
        "group": spec.group,
        "shape": spec.shape,
        "same_part": bool(case.truths),
        "right": error is not None and error.right and not error.at_rival,
        "status": result.verdict.status,
        "findings": [finding.code for finding in result.verdict.findings],
        "evidence": {each.name: each.value for each in result.verdict.evidence},
    }


def rows_of(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def run(todo: list[Spec], path: Path, processes: int) -> None:
    done = {row["case"] for row in rows_of(path)} if path.exists() else set()
    todo = [spec for spec in todo if spec.name not in done]
    os.environ |= dict.fromkeys(ONE_THREAD, "1")  # for the workers: as many threads as processes
    with (
        path.open("a", encoding="utf-8") as out,
        tempfile.TemporaryDirectory() as kept,
        ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=pipeline.preload) as pool,
    ):
        for number, row in enumerate(_results(pool, todo, Path(kept))):
            out.write(json.dumps(row) + "\n")
            out.flush()
            print(
                f"{number + 1} of {len(todo)}: {row['case']}: {row['status']}, "
                f"{'right' if row['right'] else 'wrong'}",
                flush=True,
            )


def _results(pool: ProcessPoolExecutor, todo: list[Spec], kept: Path) -> Iterator[dict[str, Any]]:
    running = [pool.submit(measured, spec, kept) for spec in todo]
    for spec, future in zip(todo, running, strict=True):
        try:
            yield future.result()
        except Exception as failed:  # a piece too small to be meshed has no pose to judge
            print(f"{spec.name}: {failed!r}"[:200], flush=True)


def fit(rows: list[dict[str, Any]], names: tuple[str, ...], truth: str) -> LogisticModel:
    """Of `truth` (a key of the rows) on the evidence of these names; right and wrong ones weigh the same."""
    values = np.array([[row["evidence"][name] for name in names] for row in rows])
    right = np.array([row[truth] for row in rows])
    model = LogisticRegression(C=REGULARISATION, max_iter=20_000).fit(values, right)
    good = np.array([row["right"] for row in rows])
    return LogisticModel(
        names,
        round(float(model.intercept_[0]), 3),
        tuple(round(float(weight), 3) for weight in model.coef_[0]),
        tuple(round(float(value), 3) for value in np.median(values[good], axis=0)),
    )


def _by_shape(rows: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    shapes = sorted({row["shape"] for row in rows})
    first = set(shapes[::2])
    return [row for row in rows if row["shape"] in first], [row for row in rows if row["shape"] not in first]


def _said(model: LogisticModel, rows: list[dict[str, Any]]) -> FloatArray:
    return np.array([probability(model, row["evidence"]) for row in rows])


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
        of_part = [row for row in rows if row["same_part"]]
        for truth, chosen, names in (
            ("same_part", rows, CONFIDENCE.same_part.names),
            ("right", of_part, CONFIDENCE.pose.names),
        ):
            for learned, kept_out in (_by_shape(chosen), _by_shape(chosen)[::-1]):
                said = _said(fit(learned, names, truth), kept_out)
                is_true = np.array([row[truth] for row in kept_out], dtype=np.float64)
                title = f"{truth}: {len(learned)} cases learned, other shapes judged"
                console.print(reliability(said, is_true, title))
            console.print(f"{truth}, all cases:", fit(chosen, names, truth))
    if args.judge:
        lines = [
            row
            for row in gauntlet_rows.read_rows(args.judge).values()
            if row.tool == gauntlet_rows.CUSP and row.confidence
        ]
        said = np.array([row.confidence for row in lines])
        right = np.array([bool(row.right) and not row.at_rival for row in lines], dtype=np.float64)
        console.print(reliability(said, right, "poses given in the gauntlet"))


if __name__ == "__main__":
    main()
