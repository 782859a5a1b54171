"""A receiver, a sender, and a service that may reach loopback."""

from collections.abc import Iterator
from typing import Any

import pytest
from sqlalchemy import Engine

from service.settings import ServiceSettings
from service.storage.database import open_database
from service.webhooks.address_guard import Guard
from service.webhooks.http_client import Poster
from tests.support.receiver import LOOPBACK, Receiver


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    made = Receiver()
    yield made
    made.stop()


@pytest.fixture
def settings(storage: dict[str, Any]) -> ServiceSettings:
    made = ServiceSettings(**storage, max_upload_mib=1, queue_limit=50, webhook_networks=LOOPBACK)
    made.make_folders()
    return made


@pytest.fixture
def engine(settings: ServiceSettings) -> Iterator[Engine]:
    made = open_database(settings.database)
    yield made
    made.dispose()


@pytest.fixture
def poster() -> Iterator[Poster]:
    made = Poster(Guard.of(LOOPBACK))
    yield made
    made.close()
