"""Jobs of before version 0014 are found by their names like new ones."""

import pytest
from sqlalchemy import text

from service.jobs.models import JobRow, new_id
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.database import migrate, open_database

pytestmark = pytest.mark.storages


def test_old_jobs_get_their_names(settings: ServiceSettings) -> None:
    engine = open_database(settings.database)
    store = JobStore(engine)
    inputs = {"scan": {"blob": "sha256:a", "filename": "Lid Ä.stl"}, "design": None}
    options = {"reference": {"serial": "S-9"}}
    row = JobRow(id=new_id(), type="registration", inputs=inputs, options=options, label="Part 7", attempt=0)
    store.add(row)
    with engine.begin() as connection:
        fresh = connection.scalar(text("SELECT names FROM jobs"))
    assert fresh == "part 7\ns-9\nlid ä.stl"
    with engine.begin() as connection:  # as a version before left it
        connection.execute(text("DROP INDEX jobs_by_names"))
        connection.execute(text("ALTER TABLE jobs DROP COLUMN names"))
        connection.execute(text("ALTER TABLE jobs DROP COLUMN within"))
        connection.execute(text("UPDATE alembic_version SET version_num = '0013'"))
    engine.dispose()
    migrate(settings.database)
    engine = open_database(settings.database)
    with engine.begin() as connection:
        assert connection.scalar(text("SELECT names FROM jobs")) == fresh
    assert [each.id for each in JobStore(engine).page(name="LID", limit=9)[0]] == [row.id]
    engine.dispose()
