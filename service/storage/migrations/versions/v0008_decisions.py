"""What became of a job's part, and which part it was: to list jobs by them."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None

COLUMNS = {"verdict": 32, "decision": 16, "serial": 100, "batch": 100, "part_number": 100}


def upgrade() -> None:
    """Jobs of before have none of it."""
    with op.batch_alter_table("jobs") as jobs:
        for name, length in COLUMNS.items():
            jobs.add_column(sa.Column(name, sa.String(length), nullable=True))
            jobs.create_index(f"jobs_by_{name}", ["tenant", name, "id"])


def downgrade() -> None:
    """Drop the columns."""
    with op.batch_alter_table("jobs") as jobs:
        for name in COLUMNS:
            jobs.drop_index(f"jobs_by_{name}")
            jobs.drop_column(name)
