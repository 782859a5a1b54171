"""What tenants keep with their designs: named regions, limits, alignment."""

import hashlib
from contextlib import suppress
from typing import Any

from sqlalchemy import JSON, BigInteger, String, delete, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, mapped_column

from pipeline import Characteristics
from service.jobs.models import Base
from service.jobs.table_access import TableAccess

ANY = "*"  # of If-Match: whatever is there; of `expected`, None: nothing may be there


class CharacteristicsRow(Base):
    """Of one design of one tenant. version : of the content, the ETag"""

    __tablename__ = "characteristics"

    tenant: Mapped[str] = mapped_column(String(64), primary_key=True)
    design: Mapped[str] = mapped_column(String(71), primary_key=True)  # id of its blob
    version: Mapped[str] = mapped_column(String(32))
    document: Mapped[dict[str, Any]] = mapped_column(JSON)  # pipeline.Characteristics, as sent
    changed_ms: Mapped[int] = mapped_column(BigInteger)


def version_of(characteristics: Characteristics) -> str:
    """The same for the same content."""
    return hashlib.sha256(characteristics.model_dump_json().encode()).hexdigest()[:32]


class CharacteristicsRecords(TableAccess):
    """One document for each design. They stay when the mesh is deleted, and hold when it is sent again."""

    def characteristics(self, design: str, tenant: str) -> CharacteristicsRow | None:
        """Those of a design; None where it has none."""
        with self._session() as session:
            return session.get(CharacteristicsRow, (tenant, design))

    def put_characteristics(
        self, design: str, tenant: str, given: Characteristics, expected: str | None = ANY
    ) -> CharacteristicsRow | None:
        """Create or replace them; None if the stored version is not `expected` (`ANY`: whatever it is, None:
        there is none).
        """
        row = CharacteristicsRow(
            tenant=tenant,
            design=design,
            version=version_of(given),
            document=given.model_dump(mode="json", exclude_unset=True),
            changed_ms=self._clock_ms(),
        )
        if expected in (None, ANY):
            with suppress(IntegrityError), self._session.begin() as session:
                session.add(row)
                session.flush()
                return row
            if expected is None:
                return None
        of_design = [CharacteristicsRow.tenant == tenant, CharacteristicsRow.design == design]
        if expected != ANY:
            of_design.append(CharacteristicsRow.version == expected)
        values = {"version": row.version, "document": row.document, "changed_ms": row.changed_ms}
        with self._session.begin() as session:
            done = session.scalars(
                update(CharacteristicsRow).where(*of_design).values(**values).returning(CharacteristicsRow),
                execution_options={"synchronize_session": False},
            )
            return done.one_or_none()

    def delete_characteristics(self, design: str, tenant: str) -> bool:
        """False if there were none."""
        of_design = (CharacteristicsRow.tenant == tenant, CharacteristicsRow.design == design)
        with self._session.begin() as session:
            done = session.execute(
                delete(CharacteristicsRow).where(*of_design).returning(CharacteristicsRow.design)
            )
            return done.scalar_one_or_none() is not None
