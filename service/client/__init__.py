"""The typed Python client of the HTTP API.

    from service.client import Client, register

    print(register("design.stl", "scan.stl", tolerance_mm=0.2).result().verdict.status)

`Client` blocks; `AsyncClient` has the same methods with `await`. See docs/python.md.
"""

from service.client.aio import AsyncClient
from service.client.requests import ServiceProblem, ServiceUnreachable
from service.client.sync import Client, register

__all__ = ["AsyncClient", "Client", "ServiceProblem", "ServiceUnreachable", "register"]
