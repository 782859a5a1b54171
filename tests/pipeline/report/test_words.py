"""The words of the report: each has its German, with the same places, and numbers follow the language."""

import ast
import re
from pathlib import Path
from string import Formatter
from typing import get_args

import pytest

import pipeline
from pipeline.core.reference import Reference
from pipeline.core.report_header import ReportHeader
from pipeline.core.results import VerdictStatus
from pipeline.report import deviation_histogram, inspection_tables, page, sections, tables, views
from pipeline.report.german import GERMAN
from pipeline.report.registration_pictures import SEGMENTS_NOTE
from pipeline.report.words import ENGLISH, Words

REPORT = Path(pipeline.__file__).parent / "report"
#: What `words` is called with by name.
BY_NAME = {
    *page.MEANING.values(),
    page.MEANING_SYMMETRIC,
    *(status.replace("_", " ") for status in get_args(VerdictStatus)),
    *(words for words, _ in inspection_tables.DECISIONS.values()),
    *inspection_tables.PASSED.values(),
    inspection_tables.AREA,
    *(note for _, note in tables.PROBABILITIES),
    *(of.replace("_", " ") for of, _ in tables.PROBABILITIES),
    tables.NOT_GIVEN,
    tables.TO_POINTS,
    *sections.MEANINGS.values(),
    *deviation_histogram.AXIS_LABELS.values(),
    SEGMENTS_NOTE,
    *(name.replace("_", " ") for name in Reference.model_fields if name != "more"),
    *("design", "scan", "mesh"),
    *(name for name in views.DIRECTIONS if name.isalpha()),
}


def called() -> set[str]:
    """Every text that code or template hands to `words`."""
    found: set[str] = set()
    for path in REPORT.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "words":
                found |= {
                    each.value
                    for argument in node.args
                    for each in ast.walk(argument)
                    if isinstance(each, ast.Constant) and isinstance(each.value, str) and len(each.value) > 1
                }
    template = (REPORT / "templates" / "report.html").read_text()
    return found | {each[1] for each in re.findall(r"words\(([\"'])(.*?)\1\)", template)}


def test_every_word_has_its_german() -> None:
    missing = (called() | BY_NAME) - GERMAN.keys()
    assert not missing


def test_the_german_has_the_same_places() -> None:
    for english, german in GERMAN.items():
        places = [{name for _, name, _, _ in Formatter().parse(text) if name} for text in (english, german)]
        assert places[0] == places[1], english


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (ENGLISH, ("+0.120", "\N{MINUS SIGN}1.50 mm", "95.7 %", "27.7", "1.00, \N{MINUS SIGN}2.50, 0.00")),
        (
            Words("de"),
            ("+0,120", "\N{MINUS SIGN}1,50 mm", "95,7 %", "27,7", "1,00; \N{MINUS SIGN}2,50; 0,00"),
        ),
    ],
)
def test_numbers_follow_the_language(words: Words, expected: tuple[str, ...]) -> None:
    said = (words.signed(0.12), words.millimetres(-1.5, 2), words.percent(0.957), words.short(27.71))
    assert (*said, words.point([1.0, -2.5, 0.0])) == expected


def test_all_and_nothing_are_said_of_all_and_nothing() -> None:
    shares = (0.0, 0.0004, 0.5, 0.9996, 1.0)
    assert [ENGLISH.percent(share) for share in shares] == [
        "0.0 %",
        "< 0.1 %",
        "50.0 %",
        "> 99.9 %",
        "100.0 %",
    ]


def test_a_logo_is_a_picture() -> None:
    assert ReportHeader(logo=b"\x89PNG\r\n\x1a\n...").logo_type == "image/png"
    with pytest.raises(ValueError, match="neither PNG nor JPEG"):
        ReportHeader(logo=b"<svg onload=alert(1)>")
