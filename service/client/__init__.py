"""The Python client of the HTTP API; it needs no library that computes.

from service.client import register

result = register("design.stl", "scan.stl", tolerance_mm=0.1).result()
print(result.verdict.status, result.metrics.rmse_mm)
"""

from service.client.aio import AsyncClient, AsyncRunning
from service.client.requests import DEFAULT_SERVER, JobOptions, ServiceProblem, ServiceUnreachable
from service.client.sync import Client, Running, register

__all__ = [
    "DEFAULT_SERVER",
    "AsyncClient",
    "AsyncRunning",
    "Client",
    "JobOptions",
    "Running",
    "ServiceProblem",
    "ServiceUnreachable",
    "register",
]
