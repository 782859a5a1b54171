"""Findings, evidence, reasons, checks and warnings have their German: a new one without it fails here."""

import ast
import re
from pathlib import Path
from string import Formatter
from typing import get_args

import pytest

import pipeline
from pipeline.core.results.inspection import Check, CheckKind
from pipeline.core.sentences import place, sentence
from pipeline.core.small_motions import SmallMotion
from pipeline.inspection.inspect import words as reason
from pipeline.report import decision_graph
from pipeline.report.deviation_histogram import AXIS_LABELS
from pipeline.report.german_findings import GERMAN_FINDINGS
from pipeline.report.german_notes import GERMAN_NOTES
from pipeline.report.words import CATALOGUES, ENGLISH, Words
from pipeline.studies import plots
from pipeline.studies.simulated_scan import conditions
from pipeline.verification.evidence import DETAILS
from pipeline.verification.findings import MOTIONS, SOURCES
from pipeline.verification.thresholds import UNIT_FACTORS

SOURCE = Path(pipeline.__file__).parent
GERMAN = Words("de")
#: Where texts for people are sentences of the catalogue: the calls that take one, and their argument.
CALLS = {"Finding": "detail", "AlignmentFailed": ""}
#: Words at the places of sentences, and names that the report shows beside figures.
PLAIN = {
    *(*MOTIONS.values(), *SOURCES.values(), *UNIT_FACTORS.values(), *DETAILS.values(), *get_args(CheckKind)),
    "every motion",
    *("longer", "shorter", "larger", "smaller", "above", "below"),
    *(name.replace("_", " ") for name in DETAILS),
}


def templates() -> set[str]:
    """The first argument of every call of `sentence` that is a text."""
    found: set[str] = set()
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "sentence":
                first = node.args[0]
                if isinstance(first, ast.Constant):
                    found.add(str(first.value))
    return found - {"{value:.1%}", "{value:.3f} mm"}


def test_every_sentence_and_word_has_its_german() -> None:
    assert not (templates() | PLAIN) - CATALOGUES["de"].keys()
    assert not GERMAN_FINDINGS.keys() - templates() - PLAIN  # none is left over


def test_every_word_of_the_pages_and_drawings_has_its_german() -> None:
    """What is given to `words` as a text, and the tables of texts that are given to it by name."""
    said: set[str] = set()
    for folder in ("report", "studies"):
        for path in (SOURCE / folder).glob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "words" and node.args:
                    first = node.args[0]
                    if isinstance(first, ast.Constant):
                        said.add(str(first.value))
    said |= {*decision_graph.RHO_LABELS.values(), *decision_graph.METHOD_LABELS.values()}
    said |= {*decision_graph.DELTA_LABEL, decision_graph.CENTRE, "informativeness", "repeatability"}
    said |= {*plots.LABELS.values(), *plots.RULE_LABELS.values(), *AXIS_LABELS.values()} - {"$T^2$", "ISS"}
    assert not said - CATALOGUES["de"].keys()


def test_conditions_of_a_study_are_translated_with_their_figures() -> None:
    found = [GERMAN.sentence(each.name) for each in conditions(None)]
    assert found == ["Rauschen 0,1%", "Rauschen 0,3%", "Rauschen 0,1%, 30% abgeschnitten"]


def test_findings_and_reasons_are_sentences() -> None:
    for folder in ("verification", "inspection"):
        for path in (SOURCE / folder).glob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                name = getattr(node.func, "id", "") if isinstance(node, ast.Call) else ""
                if isinstance(node, ast.Call) and name in CALLS:
                    given = {each.arg: each.value for each in node.keywords}
                    said = given[CALLS[name]] if CALLS[name] else node.args[0]
                    is_sentence = isinstance(said, ast.Call) and getattr(said.func, "id", "") == "sentence"
                    assert is_sentence or getattr(said, "id", "") == "detail", (path.name, node.lineno)
    inspect = ast.parse((SOURCE / "inspection/inspect.py").read_text())
    assert not [node for node in ast.walk(inspect) if isinstance(node, ast.JoinedStr)]


def test_every_warning_has_its_german() -> None:
    texts = [path.read_text() for path in SOURCE.rglob("*.py")]
    codes = {code for text in texts for code in re.findall(r'code="([a-z0-9_]+)"', text)}
    findings = set(re.findall(r'code="([a-z0-9_]+)"', (SOURCE / "verification/findings.py").read_text()))
    assert codes - findings == GERMAN_NOTES.keys()
    assert GERMAN.note("point_cloud", "scan: a point cloud").endswith("[scan: a point cloud]")
    assert ENGLISH.note("point_cloud", "scan: a point cloud") == "scan: a point cloud"


@pytest.mark.parametrize("template", sorted(templates()))
def test_a_sentence_is_found_again_by_its_text(template: str) -> None:
    names = {name: spec for _, name, spec, _ in Formatter().parse(template) if name}
    values = {name: 1.25 if spec else "hole 1.5" for name, spec in names.items()}
    values |= {name: place([1.25, 2, 3]) for name in ("place", "axis") if name in names}
    german = GERMAN.sentence(sentence(template, **values))
    assert german != sentence(template, **values)
    assert "{" not in german
    assert german.count("hole 1.5") == sum(each == "hole 1.5" for each in values.values())  # stays as it is
    assert not re.search(r"\d\.\d", german.replace("hole 1.5", ""))  # figures follow the language


def test_values_follow_the_language() -> None:
    check = Check(
        name="rim: highest",
        kind="highest",
        region="rim",
        value=0.4964,
        lower=None,
        upper=0.3,
        unit="mm",
        uncertainty=None,
        n=9,
        passed=False,
        position_mm=[32.891, -14.742, 0.0],
    )
    minus = "\N{MINUS SIGN}"
    where = f"(32.89, {minus}14.74, 0.00) mm in the frame of the design"
    english = f"rim: highest: the deviation of 0.496 mm is above its limit of 0.300 mm, at {where}"
    assert reason(check) == english
    where = f"(32,89; {minus}14,74; 0,00) mm im System des Solls"
    german = (
        f"rim: höchste Stelle: die Abweichung von 0,496 mm liegt über der Grenze von 0,300 mm, bei {where}"
    )
    assert GERMAN.sentence(english) == german
    assert GERMAN.sentence(
        sentence("the alignment is {status}, so the part is not judged", status="no match")
    ) == ("das Urteil über die Ausrichtung ist „passt nicht“; das Teil wird daher nicht bewertet")


def test_a_list_of_sentences_is_translated_one_by_one() -> None:
    motions = [
        SmallMotion("translation", (0, 0, 1), (0, 0, 0)),
        SmallMotion("rotation", (1, 0, 0), (20, 0, 0.5)),
    ]
    why = sentence(
        "the matched landmarks that it uses ({count}) leave a motion free: {motion}",
        count=2,
        motion="; ".join(map(str, motions)),
    )
    assert GERMAN.sentence(why) == (
        "die zugeordneten Landmarken, die sie verwendet (2), lassen eine Bewegung frei: "
        "die Verschiebung entlang (0; 0; 1); "
        "die Drehung um die Achse (1; 0; 0) durch (20; 0; 0,5) mm"
    )


def test_figures_have_one_style() -> None:
    assert sentence("{a:.1%} {b:.3g} {c:.3g} {d}", a=0.957, b=-12345.0, c=0.00001234, d="a-b") == (
        "95.7 % \N{MINUS SIGN}12300 0.0000123 a-b"
    )
    assert place([1.0, -2.5, 0.0], 1) == "(1.0, \N{MINUS SIGN}2.5, 0.0)"
