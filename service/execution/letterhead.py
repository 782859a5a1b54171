"""What the operator puts at the head of every report: the name and the logo of the company."""

from base64 import b64encode
from dataclasses import dataclass
from pathlib import Path

import pipeline

MAX_LOGO_BYTES = 256 * 1024


@dataclass(frozen=True, slots=True)
class Letterhead:
    """company : empty for none; logo : PNG or JPEG in base64, None for none"""

    company: str = ""
    logo: str | None = None

    @classmethod
    def of(cls, company: str, logo_path: str) -> "Letterhead":
        """Read the logo; an empty path for none.

        Raises
        ------
        ValueError
            When the logo cannot be read, is too large, or is neither PNG nor JPEG.
        """
        if not logo_path:
            return cls(company)
        try:
            data = Path(logo_path).read_bytes()
            if len(data) > MAX_LOGO_BYTES:
                raise ValueError(f"it has {len(data)} bytes; at most {MAX_LOGO_BYTES} are read")
            pipeline.ReportHeader(logo=data)
        except (OSError, ValueError) as error:
            raise ValueError(f"CUSP_REPORT_LOGO ({logo_path}) cannot be used: {error}") from error
        return cls(company, b64encode(data).decode())
