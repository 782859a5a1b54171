"""Named regions, limits and alignment that are kept with a design."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the table."""
    op.create_table(
        "characteristics",
        sa.Column("tenant", sa.String(64), primary_key=True),
        sa.Column("design", sa.String(71), primary_key=True),
        sa.Column("version", sa.String(32), nullable=False),
        sa.Column("document", sa.JSON(), nullable=False),
        sa.Column("changed_ms", sa.BigInteger, nullable=False),
    )


def downgrade() -> None:
    """Drop the table."""
    op.drop_table("characteristics")
