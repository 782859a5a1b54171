"""What lists show and search: the share of the area within the tolerance, and the names of a job."""

import json
from typing import Any

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None

BATCH = 1000  # rows of one UPDATE
MAX_NAMES = 600  # characters


def upgrade() -> None:
    """Jobs of before have names, and no share: their results are files."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.add_column(sa.Column("within", sa.Float(), nullable=True))
        jobs.add_column(sa.Column("names", sa.Text(), nullable=True))
    table = sa.table(
        "jobs", *(sa.column(name) for name in ("id", "label", "inputs", "options", "names", "removed_ms"))
    )
    connection = op.get_bind()
    query = sa.select(table.c.id, table.c.label, table.c.inputs, table.c.options)
    kept = connection.execute(query.where(table.c.removed_ms.is_(None))).all()
    rows = [{"key": row.id, "names": _names(row.label, row.inputs, row.options)} for row in kept]
    change = sa.update(table).where(table.c.id == sa.bindparam("key")).values(names=sa.bindparam("names"))
    for first in range(0, len(rows), BATCH):
        connection.execute(change, rows[first : first + BATCH])
    op.create_index("jobs_by_names", "jobs", ["tenant", "id", "names"])


def _names(label: str | None, inputs: Any, options: Any) -> str | None:
    """As `service.jobs.names` at this revision; None of a row that cannot be read."""
    try:
        sources = json.loads(inputs) if isinstance(inputs, str) else inputs
        sent = json.loads(options) if isinstance(options, str) else options
        reference = (sent or {}).get("reference") or {}
        files = [source.get("filename") for source in (sources or {}).values() if source]
    except (ValueError, AttributeError):
        return None
    keys = [reference.get(key) for key in ("part_number", "serial", "batch")]
    text = "\n".join(str(each) for each in (label, *keys, *files) if each)
    return text.lower()[:MAX_NAMES] or None


def downgrade() -> None:
    """Drop the columns."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_index("jobs_by_names")
        jobs.drop_column("names")
        jobs.drop_column("within")
