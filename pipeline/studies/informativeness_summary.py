"""Results of the informativeness study: one row a detector, the table of trials, and a paragraph of text."""

import csv
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from pipeline.core.results import InformativenessProtocol, InformativenessRow
from pipeline.core.settings import Detector
from pipeline.kernels.copy_icp import DESCRIPTIONS, RULES
from pipeline.report.words import ENGLISH, Words
from pipeline.studies.informativeness import TIE, Informativeness
from pipeline.studies.statistics import quantiles

#: K above this counts as "landmarks alone are better". The margin covers rounding; chosen by hand; not
#: fitted.
ABOVE = 1 + 1e-6
#: K from here on is reported in a column of its own (`share_at_least_10`); part of the result format.
FAR_ABOVE = 10
#: Two shares differ when they are further apart than this many standard errors (about 99.7 % for a Gaussian).
SIGNIFICANT_ERRORS = 3.0
#: Rows of trials.csv written at once: a million trials as Python numbers would take gigabytes.
ROWS_AT_ONCE = 10_000


def protocol(study: Informativeness) -> InformativenessProtocol:
    """The parameters of a study, as the result records them."""
    return InformativenessProtocol(
        trials=len(study.angle_deg),
        noise_mm=study.noise_mm,
        rotation_deg=study.rotation_deg,
        points=study.complete.points,
        count=max((found.points for found in study.landmarks.values()), default=0),
        icp=dict(DESCRIPTIONS),
        tie=TIE,
    )


def rows(study: Informativeness) -> list[InformativenessRow]:
    """One row for each rule and detector. Shares refer to all trials; the quantiles of K exclude ties (`k.n`
    trials).
    """
    return [_row(study, detector, rule) for rule in range(len(RULES)) for detector in study.landmarks]


def _row(study: Informativeness, detector: Detector, rule: int) -> InformativenessRow:
    complete, ours = study.complete.rmse_mm[:, rule], study.landmarks[detector].rmse_mm[:, rule]
    k, tie = study.k(detector)[:, rule], study.ties(detector)[:, rule]
    return InformativenessRow(
        detector=detector,
        icp=RULES[rule],
        points=study.landmarks[detector].points,
        share_above=float(np.mean((k > ABOVE) & ~tie)),
        share_tie=float(np.mean(tie)),
        share_at_least_10=float(np.mean((k >= FAR_ABOVE) & ~tie)),
        share_raw_above=float(np.mean(complete > ours)),
        k=quantiles(k[~tie]),
        rmse_complete_mm=quantiles(complete),
        rmse_landmarks_mm=quantiles(ours),
    )


def write_trials(path: Path, study: Informativeness) -> None:
    """Write trials.csv, one row for each trial; the same study gives the same bytes."""
    header = ["trial", "dx_mm", "dy_mm", "dz_mm", "angle_deg"]
    columns = [*study.translation_mm.T, study.angle_deg]
    for rule, name in enumerate(RULES):
        header.append(f"{name}_rmse_complete_mm")
        columns.append(study.complete.rmse_mm[:, rule])
        for detector, found in study.landmarks.items():
            header += [f"{name}_{detector}_rmse_landmarks_mm", f"{name}_{detector}_k"]
            columns += [found.rmse_mm[:, rule], study.k(detector)[:, rule]]
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for first in range(0, len(study.angle_deg), ROWS_AT_ONCE):
            part = np.stack([column[first : first + ROWS_AT_ONCE] for column in columns], axis=1).tolist()
            writer.writerows((first + number, *values) for number, values in enumerate(part))


def summarize(
    used: InformativenessProtocol, results: Sequence[InformativenessRow], words: Words = ENGLISH
) -> str:
    """The paragraph of the report: how often landmarks alone did better, compared with ties and random
    points.
    """
    counts = sorted({row.points for row in results})
    opening = words(
        "In {trials} trials a copy of the shape was moved by up to {noise} mm along each axis{rotation}, "
        "then registered by ICP of all {points} points and by ICP of {landmarks} landmarks alone; K is the "
        "error of the former divided by that of the latter.",
        trials=words.count(used.trials),
        noise=words.short(used.noise_mm),
        rotation=words(" and rotated by up to {angle} degrees", angle=words.local(f"{used.rotation_deg:g}"))
        if used.rotation_deg > 0
        else "",
        points=words.count(used.points),
        landmarks=f" {words('to')} ".join(str(count) for count in dict.fromkeys((counts[0], counts[-1]))),
    )
    library, converged = ([row for row in results if row.icp == rule] for rule in RULES)
    if [_shares(row) for row in library] == [_shares(row) for row in converged]:
        sentences = _sentences("With either stopping rule of ICP", library, used.trials, words)
    else:
        sentences = _sentences("With the stopping rule of the library", library, used.trials, words)
        sentences += _sentences("With ICP to convergence", converged, used.trials, words)
    raw = words(
        "Counted as in the paper, K > 1 for errors of any size, the share is {shares}",
        shares=_listed(library, _raw, words),
    )
    if any(row.share_tie > 0 for row in library):
        raw += words(
            "; in ties this compares rounding errors, which grow with the number of summed points for any "
            "choice of points"
        )
    return " ".join([opening, *sentences, f"{raw}."])


def _sentences(start: str, group: Sequence[InformativenessRow], trials: int, words: Words) -> list[str]:
    """Sentences about one stopping rule."""
    if all(row.share_tie == 1 for row in group):
        return [
            words(
                "{start}, every trial of every detector was a tie (both errors are rounding errors): the "
                "study cannot distinguish the detectors, nor landmarks from the complete shape.",
                start=words(start),
            )
        ]
    sentences = [
        words(
            "{start}, landmarks alone did better in this share of the trials: {better}; tied (both errors "
            "are rounding errors) in {tied}; and did worse in the rest.",
            start=words(start),
            better=_listed(group, _above, words),
            tied=_listed(group, _tie, words),
        )
    ]
    random = next((row for row in group if row.detector == "random"), None)
    others = [row for row in group if row.detector != "random"]
    if random is not None and others:
        apart = {row.detector: _errors_apart(_no_worse(row), _no_worse(random), trials) for row in others}
        limit = SIGNIFICANT_ERRORS
        sentences.append(
            words(
                "Better or tied more often than random points: {more}; less often: {less}; within {limit} "
                "standard errors: {alike}.",
                more=_names((each for each, errors in apart.items() if errors > limit), words),
                less=_names((each for each, errors in apart.items() if errors < -limit), words),
                limit=f"{limit:g}",
                alike=_names((each for each, errors in apart.items() if abs(errors) <= limit), words),
            )
        )
    return sentences


def _errors_apart(share: float, other: float, trials: int) -> float:
    """Difference of two shares in standard errors, for independent trials; shared trials have a smaller
    error.
    """
    variance = (share * (1 - share) + other * (1 - other)) / trials
    return (share - other) / float(np.sqrt(max(variance, 1.0 / trials**2)))


def _above(row: InformativenessRow) -> float:
    return row.share_above


def _tie(row: InformativenessRow) -> float:
    return row.share_tie


def _raw(row: InformativenessRow) -> float:
    return row.share_raw_above


def _no_worse(row: InformativenessRow) -> float:
    return row.share_above + row.share_tie


def _shares(row: InformativenessRow) -> tuple[float, float, float]:
    return row.share_above, row.share_tie, row.share_raw_above


def _listed(
    group: Sequence[InformativenessRow], share: Callable[[InformativenessRow], float], words: Words
) -> str:
    """`98.52 % (t2), 97.10 % (random)`, or one figure if all are equal."""
    values = [share(row) for row in group]
    if len(group) > 1 and len(set(values)) == 1:
        return words("{share} with every detector", share=words.percent(values[0], 2))
    return ", ".join(
        f"{words.percent(value, 2)} ({row.detector})" for value, row in zip(values, group, strict=True)
    )


def _names(detectors: Iterable[Detector], words: Words) -> str:
    return ", ".join(detectors) or words("none")
