"""Alembic's entry: runs on the connection that `service.store.migrate` opened."""

from alembic import context

from service.jobs import Base

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=Base.metadata,
    render_as_batch=True,  # SQLite cannot alter a column in place
)
with context.begin_transaction():
    context.run_migrations()
