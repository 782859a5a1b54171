"""A client of the service whose errors are one line for the person at the command line."""

from collections.abc import Iterator
from contextlib import contextmanager

from service.cli.jobs import PATIENCE_S
from service.cli.options import refuse
from service.client.requests import ServiceProblem, ServiceUnreachable
from service.client.sync import Client


@contextmanager
def connected(server: str) -> Iterator[Client]:
    """A client of `server`; a problem, or no service there, ends the command with its reason."""
    try:
        with Client(server, patience_s=PATIENCE_S) as client:
            yield client
    except ServiceProblem as error:
        refuse(error.problem.detail)
    except ServiceUnreachable as error:
        refuse(str(error))
