"""Prints the page `report.html` to `report.pdf` (A4) with WeasyPrint.

The PDF is optional, and a job never fails because of it: if the system's text libraries are missing, the note
`no_pdf` says what to install.

The same page gives the same bytes: WeasyPrint writes a date only if the page asks for one, and HarfBuzz
subsets the fonts without a time stamp (fontTools, the alternative, writes one).
"""

import io
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from pipeline.core.results import Note

NAME = "report.pdf"
#: PDF file identifier; together with a hash of the content it tells PDF readers whether the file has changed.
IDENTIFIER = b"cusp report"
REMEDY = (
    "install libpango-1.0-0 libpangoft2-1.0-0 libharfbuzz-subset0 fonts-dejavu-core (names of Debian), "
    "or set report.pdf to false; report.html prints to A4 from any browser"
)


class TextLibraryMissing(Exception):
    """A system library or font that WeasyPrint needs is missing."""


def write(page: Path, pdf: Path) -> list[Note]:
    """Print the HTML file `page` to `pdf`. Returns no note, or the note `no_pdf` if the file was not written.

    Raises
    ------
    OSError
        When `pdf` cannot be written.
    """
    try:
        weasyprint = _library()
    except TextLibraryMissing as missing:
        return [Note(code="no_pdf", detail=f"{pdf.name} was not written: {missing}; {REMEDY}")]
    from weasyprint.urls import URLFetcher

    # The page is self-contained. Only data URLs are allowed: no file and no host is read.
    fetcher = URLFetcher(allowed_protocols=("data",))
    html = weasyprint.HTML(string=page.read_text(encoding="utf-8"), url_fetcher=fetcher)
    pdf.write_bytes(html.write_pdf(pdf_identifier=IDENTIFIER, pdf_tags=True))
    return []


def _library() -> Any:
    """WeasyPrint, imported only when a PDF is written: the import loads Pango and reads the system's fonts.

    Raises
    ------
    TextLibraryMissing
    """
    try:
        with redirect_stdout(io.StringIO()):  # it prints a notice before it raises
            import weasyprint
            from weasyprint.text import ffi
    except (ImportError, OSError) as error:
        raise TextLibraryMissing(str(error).partition("\n")[0]) from error
    if ffi.harfbuzz_subset is None:
        # fontTools would subset the fonts instead, with a time stamp.
        raise TextLibraryMissing("libharfbuzz-subset is not installed")
    if not ffi.fontconfig.FcConfigGetFonts(ffi.ffi.NULL, ffi.fontconfig.FcSetSystem).nfont:
        raise TextLibraryMissing("no font is installed")
    return weasyprint
