"""The API process."""

import os
import tempfile

import uvicorn

from service.api.app import create_app
from service.api.garbage import settle_objects
from service.settings import ServiceSettings

KEEP_ALIVE_S = 15
STOP_TIMEOUT_S = 3  # for active requests; a long poll ends early


def run_api(settings: ServiceSettings) -> int:
    """Serve until SIGTERM or SIGINT. Returns the exit code."""
    tempfile.tempdir = str(settings.tmp_dir)  # spooled form uploads; of this process, so not in `create_app`
    server = uvicorn.Server(configuration(settings))
    settle_objects()
    server.run()
    return 0 if server.started else 1


def configuration(settings: ServiceSettings) -> uvicorn.Config:
    """Configuration of uvicorn."""
    return uvicorn.Config(
        create_app(settings),
        host=settings.host,
        port=settings.port,
        log_config=None,  # ours is set up already
        access_log=settings.log_level == "debug",
        server_header=False,
        # Any client may send `X-Forwarded-For`: it is read only if the trusted proxies are configured.
        proxy_headers="FORWARDED_ALLOW_IPS" in os.environ,
        timeout_keep_alive=KEEP_ALIVE_S,
        timeout_graceful_shutdown=STOP_TIMEOUT_S,
    )
