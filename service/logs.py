"""Structured logs on standard error: readable on a terminal, one JSON object per line elsewhere."""

import logging
import sys
from collections.abc import MutableMapping
from typing import Any

import structlog

from service.settings import ServiceSettings


def set_up_logs(settings: ServiceSettings, process: str) -> None:
    """Configure logging of the service and its libraries. process : name in each line"""
    on_terminal = settings.log_format == "console" or (settings.log_format == "auto" and sys.stderr.isatty())

    def add_process(_: Any, __: str, event: MutableMapping[str, Any]) -> MutableMapping[str, Any]:
        return {"process": process, **event}

    shared: list[Any] = [
        add_process,
        structlog.contextvars.merge_contextvars,
        structlog.stdlib.add_log_level,
        structlog.processors.TimeStamper(fmt="iso", utc=True),
    ]
    last: list[Any] = (
        [
            structlog.dev.ConsoleRenderer(
                colors=sys.stderr.isatty(),
                # the default prints whole meshes as locals
                exception_formatter=structlog.dev.plain_traceback,
            )
        ]
        if on_terminal
        else [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
    )
    structlog.configure(
        processors=[*shared, structlog.stdlib.ProcessorFormatter.wrap_for_formatter],
        logger_factory=structlog.stdlib.LoggerFactory(),
        wrapper_class=structlog.make_filtering_bound_logger(logging.getLevelName(settings.log_level.upper())),
    )
    handler = logging.StreamHandler(sys.stderr)
    remove_meta = structlog.stdlib.ProcessorFormatter.remove_processors_meta
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(processors=[remove_meta, *last], foreign_pre_chain=shared)
    )
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(settings.log_level.upper())
    for name, level in {"dbos": "WARNING", "alembic": "WARNING", "httpx": "WARNING"}.items():
        library = logging.getLogger(name)
        library.handlers, library.propagate = [], True
        library.setLevel(level)
