"""PostgreSQL notifies the API processes of each change of a job that clients see."""

from alembic import op

revision = "0013"
down_revision = "0012"
branch_labels = None
depends_on = None

#: What `JobStore.fingerprints` compares. Heartbeats change none of them.
SHOWN = ("status", "stage", "progress", "message", "attempt", "removed_ms")


def upgrade() -> None:
    """A trigger; SQLite has no notices, so there the API asks."""
    if op.get_bind().dialect.name != "postgresql":
        return
    op.execute(
        "CREATE FUNCTION cusp_job_changed() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN PERFORM pg_notify('cusp_jobs', NEW.id); RETURN NULL; END $$"
    )
    changed = " OR ".join(f"OLD.{column} IS DISTINCT FROM NEW.{column}" for column in SHOWN)
    op.execute(
        f"CREATE TRIGGER cusp_job_changed AFTER UPDATE OF {', '.join(SHOWN)} ON jobs "
        f"FOR EACH ROW WHEN ({changed}) EXECUTE FUNCTION cusp_job_changed()"
    )


def downgrade() -> None:
    """Drop the trigger."""
    if op.get_bind().dialect.name == "postgresql":
        op.execute("DROP TRIGGER cusp_job_changed ON jobs")
        op.execute("DROP FUNCTION cusp_job_changed()")
