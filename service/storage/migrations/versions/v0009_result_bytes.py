"""The size of the published files of a job, for the quota of its tenant."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Results of before count as nothing; retention removes them."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.add_column(sa.Column("result_bytes", sa.BigInteger, nullable=False, server_default="0"))


def downgrade() -> None:
    """Drop the column."""
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_column("result_bytes")
