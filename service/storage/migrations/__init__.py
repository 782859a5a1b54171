"""Alembic's scripts, run by `service.storage.database.migrate` at start."""
