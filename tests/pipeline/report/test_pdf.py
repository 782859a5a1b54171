"""`report.pdf` is `report.html` on paper: the same words and pictures, whole, alone, and the same each
time.
"""

import io
import os
import re
import socket
import subprocess
import sys
from base64 import b64decode
from html import unescape
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from fontTools.ttLib import TTFont
from PIL import Image
from pypdf import PdfReader
from pypdf.generic import DictionaryObject

import pipeline
from pipeline.core.results import Check, RegistrationResult
from pipeline.report import pdf as report_pdf
from pipeline.report.page import registration
from pipeline.report.registration_pictures import PageViews
from pipeline.report.render import png
from pipeline.report.sections import Legend, Pictures
from pipeline.report.shots import PICTURE_PX, Shot
from tests.support.meshes import blob_stl
from tests.support.settings import FAST as SMALL

MM_PER_POINT = 25.4 / 72
PAGE = "<!doctype html><html lang='en'><head><title>t</title></head><body>{}</body></html>"


def settings(*, pdf: bool) -> pipeline.Settings:
    return pipeline.Settings.model_validate({**SMALL, "report": {"pdf": pdf}})


@pytest.mark.parametrize("asked", ["pdf", "three_mf"])
def test_a_file_that_no_file_is_written_for_is_refused(asked: str) -> None:
    with pytest.raises(ValueError, match=r"need report\.write_files"):
        pipeline.Settings.model_validate({"report": {"write_files": False, asked: True}})


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, RegistrationResult]:
    folder = tmp_path_factory.mktemp("job")
    (folder / "d.stl").write_bytes(blob_stl())
    (folder / "s.stl").write_bytes(blob_stl(23, 37, turn_deg=25.0, shift_mm=(4.0, -3.0, 2.0)))
    given = (folder / "d.stl", folder / "s.stl")
    result = pipeline.register(*given, settings=settings(pdf=True), tolerance_mm=0.05, out=folder / "out")
    return folder / "out", result


def words(pdf: bytes) -> list[str]:
    """Of each page, with its lines joined."""
    return [" ".join(page.extract_text().split()) for page in PdfReader(io.BytesIO(pdf)).pages]


def printed(tmp_path: Path, body: str) -> bytes:
    (tmp_path / "p.html").write_text(PAGE.format(body), encoding="utf-8")
    assert report_pdf.write(tmp_path / "p.html", tmp_path / "p.pdf") == []
    return (tmp_path / "p.pdf").read_bytes()


def test_it_says_what_the_results_say(made: tuple[Path, RegistrationResult]) -> None:
    out, result = made
    assert "report.pdf" in result.files and not [note for note in result.warnings if note.code == "no_pdf"]
    pages = words((out / "report.pdf").read_bytes())
    assert result.deviation is not None and result.metrics.rmse_mm is not None
    within = f"{100 * (result.deviation.within or 0):.1f} %"
    for figure in (f"{result.deviation.rms_mm:.3f} mm", within, "ok confidence"):
        assert figure in pages[0]
    assert f"RMSE of the final pose {result.metrics.rmse_mm:.3f} mm" in " ".join(pages)
    assert result.provenance.inputs.scan.sha256 in "".join(pages).replace(" ", "")
    assert "Histogram of the deviation" in pages[0]  # the first page is the whole summary
    for number, text in enumerate(pages, start=1):
        assert f"page {number} of {len(pages)}" in text
        assert f"scan {result.provenance.inputs.scan.sha256[:12]}" in text


def test_a_summary_with_checks_has_one_page(made: tuple[Path, RegistrationResult], tmp_path: Path) -> None:
    out, result = made
    white = png(np.ones((PICTURE_PX[1], PICTURE_PX[0], 3)))
    shots = [Shot(name, white, 100.0, "5 mm", [], *PICTURE_PX) for name in ("+x", "+z", "oblique", "-z")]
    legend = Legend(["#fff"], [(0.5, "0")], "Blue: material is missing. Red: excess material.")
    views = PageViews(Pictures("Views", "", shots, legend=legend), None, Pictures("", "", []), "")
    assert result.inspection is not None
    check = {"kind": "point", "region": None, "value": 0.5, "lower": None, "upper": 0.3, "unit": "mm"}
    check |= {"uncertainty": 0.01, "n": 9, "passed": False, "position_mm": [1.0, 2.0, 3.0]}
    checks = [Check.model_validate(check | {"name": f"check {k}"}) for k in range(4)]
    judged = result.inspection.model_copy(update={"checks": checks, "reasons": ["check 0: too high"] * 2})
    given = result.model_copy(update={"inspection": judged})
    (tmp_path / "page.html").write_text(registration(given, views, out, summary=True))
    report_pdf.write(tmp_path / "page.html", tmp_path / "page.pdf")
    (text,) = words((tmp_path / "page.pdf").read_bytes())
    assert "Histogram of the deviation" in text and "check 3" in text


def test_its_pages_are_a4(made: tuple[Path, RegistrationResult]) -> None:
    for page in PdfReader(made[0] / "report.pdf").pages:
        size_mm = (float(page.mediabox.width) * MM_PER_POINT, float(page.mediabox.height) * MM_PER_POINT)
        assert size_mm == pytest.approx((210.0, 297.0), abs=0.1)


def test_it_has_the_pictures_of_the_page_to_the_pixel(made: tuple[Path, RegistrationResult]) -> None:
    out, _ = made
    shown = re.findall(r"data:image/png;base64,([^\"]+)", (out / "report.html").read_text())
    assert len(shown) == 8
    kept = {
        np.asarray(each.image.convert("RGB")).tobytes()
        for page in PdfReader(out / "report.pdf").pages
        for each in page.images
        if each.image is not None
    }
    for picture in shown:
        assert np.asarray(Image.open(io.BytesIO(b64decode(picture))).convert("RGB")).tobytes() in kept


def test_every_character_is_of_a_font_that_the_file_holds(made: tuple[Path, RegistrationResult]) -> None:
    out, _ = made
    names: set[str] = set()
    for page in PdfReader(out / "report.pdf").pages:
        resources = page["/Resources"].get_object()
        assert isinstance(resources, DictionaryObject)
        for font in resources["/Font"].get_object().values():
            names.add(font["/BaseFont"].partition("+")[2])
            descriptor = font["/DescendantFonts"][0]["/FontDescriptor"]
            assert len(descriptor["/FontFile2"].get_object().get_data()) > 1000
    assert names and all(name.startswith("DejaVu-Sans") for name in names)  # and no other took over
    text = unescape(
        re.sub(r"<style>.*?</style>|<[^>]+>", "", (out / "report.html").read_text(), flags=re.DOTALL)
    )
    family = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
    with TTFont(family) as has:
        assert {each for each in text if not each.isspace()} <= {chr(code) for code in has.getBestCmap()}
    assert "±" in set("".join(words((out / "report.pdf").read_bytes())))


def test_the_same_page_gives_the_same_bytes_in_any_process(made: tuple[Path, RegistrationResult]) -> None:
    page, first = made[0] / "report.html", (made[0] / "report.pdf").read_bytes()
    again = page.with_name("again.pdf")
    assert report_pdf.write(page, again) == [] and again.read_bytes() == first
    script = (
        "import sys, pathlib; from pipeline.report.pdf import write; write(*map(pathlib.Path, sys.argv[1:]))"
    )
    elsewhere = {**os.environ, "PYTHONHASHSEED": "7", "TZ": "Asia/Tokyo", "SOURCE_DATE_EPOCH": "1"}
    subprocess.run([sys.executable, "-c", script, page, again], check=True, env=elsewhere)
    assert again.read_bytes() == first
    again.unlink()
    said = PdfReader(io.BytesIO(first)).metadata
    assert said is not None and said.creation_date is None and said.modification_date is None


def test_nothing_is_fetched(tmp_path: Path) -> None:
    """Neither a file of the machine nor a host: what the page itself does not hold is left out."""
    Image.new("RGB", (8, 8), (255, 0, 0)).save(tmp_path / "secret.png")
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = f"http://127.0.0.1:{server.getsockname()[1]}/a"
        links = (
            f"<link rel='stylesheet' href='{url}.css'><link rel='attachment' "
            f"href='{tmp_path.as_uri()}/secret.png'>"
        )
        pictures = f"<img alt='left' src='{tmp_path.as_uri()}/secret.png'><img alt='out' src='{url}.png'>"
        pdf = printed(tmp_path, links + pictures)
        server.settimeout(0.1)
        with pytest.raises(TimeoutError):
            server.accept()
    reader = PdfReader(io.BytesIO(pdf))
    assert "left" in words(pdf)[0] and "out" in words(pdf)[0]
    assert not reader.attachments and not any(list(page.images) for page in reader.pages)


def test_a_long_table_names_its_columns_on_each_page(tmp_path: Path) -> None:
    rows = "".join(f"<tr><td>{number}</td></tr>" for number in range(150))
    pages = words(
        printed(tmp_path, f"<table><thead><tr><th>segment</th></tr></thead><tbody>{rows}</tbody></table>")
    )
    assert len(pages) > 1 and all("segment" in text for text in pages)


def test_it_is_not_made_unless_asked_for(tmp_path: Path) -> None:
    (tmp_path / "m.stl").write_bytes(blob_stl())
    result = pipeline.find_landmarks(tmp_path / "m.stl", settings=settings(pdf=False), out=tmp_path / "out")
    assert "report.pdf" not in result.files and not (tmp_path / "out" / "report.pdf").exists()
    assert not pipeline.Settings().report.pdf


def without_pango(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """WeasyPrint as it is where Pango is not: importing it prints, then raises OSError."""
    (tmp_path / "fake" / "weasyprint").mkdir(parents=True)
    raises = (
        "print('follow the steps')\nraise OSError('cannot load library libpango-1.0-0: no such "
        "file\\nmore')\n"
    )
    (tmp_path / "fake" / "weasyprint" / "__init__.py").write_text(raises)
    for name in [name for name in sys.modules if name.partition(".")[0] == "weasyprint"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path / "fake")


def test_a_missing_library_is_a_warning_that_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    without_pango(tmp_path, monkeypatch)
    (tmp_path / "m.stl").write_bytes(blob_stl())
    result = pipeline.find_landmarks(tmp_path / "m.stl", settings=settings(pdf=True), out=tmp_path / "out")
    assert "report.html" in result.files and "report.pdf" not in result.files
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == result.files
    (note,) = (note for note in result.warnings if note.code == "no_pdf")
    assert (
        "cannot load library libpango-1.0-0: no such file;" in note.detail
        and "libharfbuzz-subset0" in note.detail
    )
    assert "no_pdf" in (tmp_path / "out" / "results.json").read_text()
    assert capfd.readouterr().out == ""


def test_fonts_are_never_cut_the_way_that_stamps_the_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from weasyprint.text import ffi

    monkeypatch.setattr(ffi, "harfbuzz_subset", None)
    (tmp_path / "p.html").write_text(PAGE.format("a"), encoding="utf-8")
    (note,) = report_pdf.write(tmp_path / "p.html", tmp_path / "p.pdf")
    assert note.code == "no_pdf" and "libharfbuzz-subset" in note.detail and not (tmp_path / "p.pdf").exists()
