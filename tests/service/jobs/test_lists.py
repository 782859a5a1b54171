"""Lists of jobs use an index, whatever they are filtered by: measured by `tests/accuracy/job_lists.py`."""

import pytest
from sqlalchemy import text

from service.storage.database import open_database
from tests.accuracy.job_lists import FILTERS, fill, plan
from tests.support.service import Service

pytestmark = pytest.mark.storages


@pytest.mark.parametrize("filters", FILTERS, ids=lambda filters: "+".join(filters))
def test_a_list_does_not_read_the_whole_table(service: Service, filters: dict[str, str]) -> None:
    engine = open_database(service.settings.database)
    fill(engine, 2000)
    with engine.begin() as connection:
        connection.execute(text("ANALYZE"))
    found = plan(engine, filters)
    engine.dispose()
    assert "jobs_by_" in found, found
    assert "Seq Scan" not in found, found
    assert "SCAN jobs\n" not in found, found
