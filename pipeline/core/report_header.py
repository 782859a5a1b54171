"""What the head of a report says beside the results: whose report it is, of which files, which job, when."""

from dataclasses import dataclass, field, replace

#: First bytes of the pictures that may be a logo, and their types.
LOGO_TYPES = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg"}


@dataclass(frozen=True, slots=True)
class ReportHeader:
    """job : id of the job, created : when it was sent (ISO 8601), None where there is none; company : name,
    empty for none; logo : PNG or JPEG, None for none; files : name of each mesh, by its role (the workflows
    fill it)

    Raises
    ------
    ValueError
        When the logo is neither PNG nor JPEG.
    """

    job: str | None = None
    created: str | None = None
    company: str = ""
    logo: bytes | None = None
    files: dict[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.logo is not None and self.logo_type is None:
            raise ValueError("the logo of the report is neither PNG nor JPEG")

    def of_files(self, **files: str | None) -> "ReportHeader":
        """With the names of the files, by role; those without a name are left out."""
        named = {role: name for role, name in files.items() if name}
        return replace(self, files={**named, **self.files})

    @property
    def logo_type(self) -> str | None:
        """MIME type of the logo; None without one, and of another format."""
        data = self.logo or b""
        return next((kind for head, kind in LOGO_TYPES.items() if data.startswith(head)), None)
