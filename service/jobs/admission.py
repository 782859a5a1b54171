"""May more jobs wait? Asked before the meshes of a request are read, and again in the transaction that stores
its jobs, since other requests are stored at the same time.
"""

from dataclasses import dataclass

from sqlalchemy import func, select, text
from sqlalchemy.orm import Session

from service.contract.errors import QueueFull, TenantQueueFull
from service.contract.schemas import Status
from service.jobs.models import JobRow

#: Of PostgreSQL (`pg_advisory_xact_lock`): one transaction at a time stores jobs. SQLite has one writer.
ADMISSION_LOCK = 0x63757370


@dataclass(frozen=True, slots=True)
class QueueLimits:
    """How many jobs may wait: of one tenant, and of all."""

    of_tenant: int
    of_all: int

    def check(self, waiting_of_tenant: int, waiting: int) -> None:
        """Numbers with the new jobs. Raises TenantQueueFull, QueueFull."""
        if waiting_of_tenant > self.of_tenant:
            raise TenantQueueFull(
                f"a tenant may have {self.of_tenant} jobs that wait, and with this there would be more; send "
                "it again when some have ended"
            )
        if waiting > self.of_all:
            raise QueueFull(
                f"{self.of_all} jobs may wait, and with this there would be more; send it again later"
            )


def begin_admission(session: Session) -> None:
    """Call first in a transaction that stores jobs."""
    if session.get_bind().dialect.name == "postgresql":
        session.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": ADMISSION_LOCK})


def end_admission(session: Session, tenant: str, limits: QueueLimits | None) -> None:
    """Call last: the new jobs count. Raises as `QueueLimits.check`; the transaction is void then."""
    session.flush()  # from here on nobody else writes
    if limits is None:
        return
    query = select(func.count()).where(JobRow.status == Status.ACCEPTED)
    of_tenant, of_all = (session.scalar(each) or 0 for each in (query.where(JobRow.tenant == tenant), query))
    limits.check(of_tenant, of_all)
