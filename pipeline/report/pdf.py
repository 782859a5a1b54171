"""`report.pdf`: the page `report.html` on A4, by WeasyPrint. An option, and never a reason for a job to fail:
where the system's text libraries are missing, the note `no_pdf` says what to install.

The same page gives the same bytes: WeasyPrint writes no date unless a page asks for one, names fonts by what
they are, and HarfBuzz cuts them without the time stamp that its other way of cutting (fontTools) leaves in
them.
"""

import io
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

from pipeline.core.results import Note

NAME = "report.pdf"
IDENTIFIER = (
    b"cusp report"  # of the kind of file; PDF readers see with it and a hash of the content what is new
)
REMEDY = (
    "install libpango-1.0-0 libpangoft2-1.0-0 libharfbuzz-subset0 fonts-dejavu-core (names of Debian), "
    "or set report.pdf to false; report.html prints to A4 from any browser"
)


class TextLibraryMissing(Exception):
    """Of what WeasyPrint loads from the system, something is not there."""


def write(page: Path, pdf: Path) -> list[Note]:
    """Print the HTML file `page` to `pdf`. Returns nothing to say, or why there is no such file.

    Raises
    ------
    OSError, when `pdf` cannot be written
    """
    try:
        weasyprint = _library()
    except TextLibraryMissing as missing:
        return [Note(code="no_pdf", detail=f"{pdf.name} was not written: {missing}; {REMEDY}")]
    from weasyprint.urls import URLFetcher

    # The page holds all it shows: whatever else it might name, a file or a host, is not looked at.
    fetcher = URLFetcher(allowed_protocols=("data",))
    html = weasyprint.HTML(string=page.read_text(encoding="utf-8"), url_fetcher=fetcher)
    pdf.write_bytes(html.write_pdf(pdf_identifier=IDENTIFIER, pdf_tags=True))
    return []


def _library() -> Any:
    """WeasyPrint, imported when a PDF is wanted: it loads Pango and reads the system's fonts then.

    Raises
    ------
    TextLibraryMissing
    """
    try:
        with redirect_stdout(io.StringIO()):  # it prints a notice of its own before it raises
            import weasyprint
            from weasyprint.text import ffi
    except (ImportError, OSError) as error:
        raise TextLibraryMissing(str(error).partition("\n")[0]) from error
    if ffi.harfbuzz_subset is None:
        raise TextLibraryMissing(
            "libharfbuzz-subset is not installed"
        )  # fonts would be cut with a time stamp in them
    if not ffi.fontconfig.FcConfigGetFonts(ffi.ffi.NULL, ffi.fontconfig.FcSetSystem).nfont:
        raise TextLibraryMissing("no font is installed")
    return weasyprint
