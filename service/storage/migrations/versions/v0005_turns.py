"""Fair share: each job's place in the queue."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """What waits already comes first, all at once: its tickets tell its order."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.add_column(sa.Column("turn", sa.Integer, nullable=False, server_default="0"))
        jobs.create_index("jobs_by_turn", ["status", "turn"])
        jobs.create_index("jobs_by_tenant_turn", ["tenant", "status", "turn"])


def downgrade() -> None:
    """Drop the column."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_index("jobs_by_tenant_turn")
        jobs.drop_index("jobs_by_turn")
        jobs.drop_column("turn")
