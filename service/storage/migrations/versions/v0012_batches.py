"""Many scans of one design at once, and an index for lists by verdict and decision together."""

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the table; jobs of before belong to no batch."""
    op.create_table(
        "batches",
        sa.Column("id", sa.String(36), primary_key=True),
        sa.Column("tenant", sa.String(64), nullable=False),
        sa.Column("label", sa.String(200), nullable=True),
        sa.Column("webhook_url", sa.String(2000), nullable=True),
        sa.Column("total", sa.Integer, nullable=False),
        sa.Column("unfinished", sa.Integer, nullable=False),
        sa.Column("created_ms", sa.BigInteger, nullable=False),
        sa.Column("finished_ms", sa.BigInteger, nullable=True),
    )
    op.create_index("batches_by_tenant", "batches", ["tenant", "id"])
    with op.batch_alter_table("jobs") as jobs:
        jobs.add_column(sa.Column("batch_id", sa.String(36), nullable=True))
        jobs.add_column(sa.Column("batch_index", sa.Integer, nullable=True))
        jobs.create_index("jobs_by_batch_id", ["batch_id", "batch_index"])
        jobs.create_index("jobs_by_outcome", ["tenant", "verdict", "decision", "id"])


def downgrade() -> None:
    """Drop them; the jobs stay."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_index("jobs_by_outcome")
        jobs.drop_index("jobs_by_batch_id")
        jobs.drop_column("batch_index")
        jobs.drop_column("batch_id")
    op.drop_table("batches")
