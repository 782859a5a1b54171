"""The receiver of a message, so that receivers take turns."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Messages of before take turns by their whole address."""
    with op.batch_alter_table("deliveries") as deliveries:
        deliveries.add_column(sa.Column("receiver", sa.String(300), nullable=False, server_default=""))
        deliveries.create_index("deliveries_by_tenant", ["tenant", "state", "id"])
    op.execute("UPDATE deliveries SET receiver = substr(url, 1, 300)")


def downgrade() -> None:
    """Drop the column."""
    with op.batch_alter_table("deliveries") as deliveries:
        deliveries.drop_index("deliveries_by_tenant")
        deliveries.drop_column("receiver")
