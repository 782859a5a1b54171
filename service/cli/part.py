"""One part of the service in a process of its own: `python -m service.cli.part api|worker [--parent PID]`.

`cusp up` starts both; `cusp api` and `cusp worker` become one. Separate from the command line, since the API
does not need its libraries.
"""

import os
import sys
from typing import NoReturn

from pydantic import ValidationError

from service.contract.invalid_values import reason
from service.execution.process import die_with_parent, keep_secrets
from service.logs import set_up_logs
from service.settings import ServiceSettings


def run_part(name: str, parent: int) -> int:
    """Run until a signal. parent : pid of `cusp up`, which prepared folders and tables, and with which this
    ends; 0: none
    """
    keep_secrets()
    try:
        settings = ServiceSettings()
    except ValidationError as error:
        return refuse(
            "; ".join(
                f"CUSP_{'.'.join(map(str, each['loc'])).upper()}: {reason(each)}" for each in error.errors()
            )
        )
    set_up_logs(settings, name)
    if parent:
        die_with_parent(parent)
        return _run(name, settings)
    from service.auth.keys import Exposed
    from service.execution.supervisor import AlreadyRunning, NotApart, prepare
    from service.storage.database import NoDatabase

    try:
        lock = prepare(settings, name)
    except (AlreadyRunning, Exposed, NotApart, NoDatabase) as error:
        return refuse(str(error))
    from sqlalchemy.exc import DBAPIError

    with lock:
        try:
            return _run(name, settings)
        except DBAPIError as error:  # while it starts; later a part waits for its database
            return refuse(
                f"the database went away during the start: {str(error.orig).strip()}; start this again"
            )


def refuse(reason: str) -> int:
    """Print the reason in one line. Returns the exit code."""
    print(f"cusp: {reason}", file=sys.stderr)  # noqa: T201 (for the terminal, before or instead of a log)
    return 1


def become(name: str) -> NoReturn:
    """Replace this process by this part, without the libraries loaded so far."""
    sys.stdout.flush()
    sys.stderr.flush()
    os.execv(sys.executable, [sys.executable, "-m", "service.cli.part", name])  # noqa: S606 (our own module)


def _run(name: str, settings: ServiceSettings) -> int:
    if name == "api":
        from service.api.server import run_api

        return run_api(settings)
    from service.execution.worker_process import run_worker

    return run_worker(settings)


if __name__ == "__main__":
    name, parent = sys.argv[1], int(sys.argv[3]) if sys.argv[2:3] == ["--parent"] else 0
    os._exit(run_part(name, parent))  # a thread of DBOS that waits must not keep the process
