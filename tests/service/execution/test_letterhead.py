"""What the operator puts at the head of reports is checked when the worker starts."""

from base64 import b64decode
from pathlib import Path

import pytest
from PIL import Image

from service.execution.child import _header
from service.execution.letterhead import MAX_LOGO_BYTES, Letterhead


def test_the_logo_reaches_the_report(tmp_path: Path) -> None:
    path = tmp_path / "logo.png"
    Image.new("RGB", (4, 4), (0, 80, 160)).save(path)
    letterhead = Letterhead.of("Muster GmbH", str(path))
    assert letterhead.logo is not None and b64decode(letterhead.logo) == path.read_bytes()
    stated = {"job": "a", "created": None, "company": letterhead.company, "logo": letterhead.logo}
    header = _header(stated)
    assert header is not None and header.company == "Muster GmbH" and header.logo == path.read_bytes()
    assert Letterhead.of("", "") == Letterhead()


@pytest.mark.parametrize("content", [None, b"<svg/>", b"\x89PNG\r\n\x1a\n" + bytes(MAX_LOGO_BYTES)])
def test_a_logo_that_cannot_be_used_says_why(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "logo"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ValueError, match="CUSP_REPORT_LOGO"):
        Letterhead.of("", str(path))
