"""Which jobs have a ticket for the queue."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """What waits already is given a ticket once more, which does nothing where there is one."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.add_column(sa.Column("has_ticket", sa.Boolean, nullable=False, server_default=sa.false()))
        jobs.create_index("jobs_by_ticket", ["has_ticket", "status", "turn"])


def downgrade() -> None:
    """Drop the column."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_index("jobs_by_ticket")
        jobs.drop_column("has_ticket")
