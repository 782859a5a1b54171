"""Who owns what: a tenant for jobs and blobs, and the keys that stand for tenants."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """What is there already belongs to the tenant of a service without keys."""
    tenant = sa.Column("tenant", sa.String(64), nullable=False, server_default="default")
    with op.batch_alter_table("jobs") as jobs:
        jobs.add_column(tenant)
        jobs.create_index("jobs_by_tenant", ["tenant", "id"])
    op.create_table(
        "owned_blobs",
        sa.Column("tenant", sa.String(64), primary_key=True),
        sa.Column("id", sa.String(71), primary_key=True),
        sa.Column("size", sa.BigInteger, nullable=False),
        sa.Column("format", sa.String(8), nullable=False),
        sa.Column("created_ms", sa.BigInteger, nullable=False),
    )
    op.execute(
        "INSERT INTO owned_blobs (tenant, id, size, format, created_ms) "
        "SELECT 'default', id, size, format, created_ms FROM blobs"
    )
    op.drop_table("blobs")
    op.rename_table("owned_blobs", "blobs")
    op.create_table(
        "api_keys",
        sa.Column("id", sa.String(16), primary_key=True),
        sa.Column("tenant", sa.String(64), nullable=False),
        sa.Column("scopes", sa.JSON, nullable=False),
        sa.Column("name", sa.String(200), nullable=False),
        sa.Column("secret_sha256", sa.String(64), nullable=False),
        sa.Column("created_ms", sa.BigInteger, nullable=False),
        sa.Column("revoked_ms", sa.BigInteger),
    )


def downgrade() -> None:
    """One tenant again."""
    op.drop_table("api_keys")
    op.create_table(
        "all_blobs",
        sa.Column("id", sa.String(71), primary_key=True),
        sa.Column("size", sa.BigInteger, nullable=False),
        sa.Column("format", sa.String(8), nullable=False),
        sa.Column("created_ms", sa.BigInteger, nullable=False),
    )
    op.execute(
        "INSERT INTO all_blobs (id, size, format, created_ms) "
        "SELECT id, MAX(size), MAX(format), MIN(created_ms) FROM blobs GROUP BY id"
    )
    op.drop_table("blobs")
    op.rename_table("all_blobs", "blobs")
    with op.batch_alter_table("jobs") as jobs:
        jobs.drop_index("jobs_by_tenant")
        jobs.drop_column("tenant")
