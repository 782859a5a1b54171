"""The API process."""

import os

import uvicorn

from service.api.app import create_app
from service.settings import ServiceSettings

KEEP_ALIVE_S = 15
STOP_TIMEOUT_S = 3  # for requests that run; a long poll gives up its wait


def run_api(settings: ServiceSettings) -> int:
    """Serve until SIGTERM or SIGINT. Returns the exit code."""
    server = uvicorn.Server(configuration(settings))
    server.run()
    return 0 if server.started else 1


def configuration(settings: ServiceSettings) -> uvicorn.Config:
    """Of the server."""
    return uvicorn.Config(
        create_app(settings),
        host=settings.host,
        port=settings.port,
        log_config=None,  # ours is set up already
        access_log=settings.log_level == "debug",
        server_header=False,
        # Whoever reaches the port may claim to be anybody: `X-Forwarded-For` is read only where uvicorn is told whom to trust.
        proxy_headers="FORWARDED_ALLOW_IPS" in os.environ,
        timeout_keep_alive=KEEP_ALIVE_S,
        timeout_graceful_shutdown=STOP_TIMEOUT_S,
    )
