"""Alembic's scripts, run by `service.store.migrate` at start."""
