"""The worker's side of webhooks: sends messages that are due and stores the results."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime

import structlog
from standardwebhooks import Webhook

from service.contract.schemas import DeliveryState
from service.jobs.deliveries import DeliveryRow
from service.jobs.models import now_ms
from service.webhooks.http_client import Poster
from service.webhooks.outbox import Deliveries
from service.webhooks.receivers import SENDERS, Receivers

POLL_INTERVAL_S = 0.5
log = structlog.get_logger()


def signed_headers(message_id: str, body: str, keys: Sequence[str], at_ms: int) -> dict[str, str]:
    """The three headers of Standard Webhooks."""
    at = datetime.fromtimestamp(at_ms // 1000, UTC)
    return {
        "webhook-id": message_id,
        "webhook-timestamp": str(at_ms // 1000),
        "webhook-signature": " ".join(Webhook(key).sign(message_id, at, body) for key in keys),
    }


@dataclass(slots=True)
class Sender:
    """Sends due messages, several at a time. Any number of workers may run one."""

    deliveries: Deliveries
    poster: Poster
    clock_ms: Callable[[], int] = now_ms

    def run(self, stop: threading.Event) -> None:
        """Send until `stop` is set. Messages that are being sent then are sent again later."""
        receivers, wake = Receivers(), threading.Event()
        with ThreadPoolExecutor(SENDERS, thread_name_prefix="webhook") as pool:
            busy = threading.Semaphore(SENDERS)
            while not stop.is_set():
                try:
                    self._round(pool, busy, receivers, wake)
                except Exception:
                    log.exception("webhooks not sent")  # most likely the database is unavailable
                    stop.wait(POLL_INTERVAL_S)
                wake.wait(POLL_INTERVAL_S)  # or until a place is free
                wake.clear()
            pool.shutdown(wait=False, cancel_futures=True)

    def _round(
        self,
        pool: ThreadPoolExecutor,
        busy: threading.Semaphore,
        receivers: Receivers,
        wake: threading.Event,
    ) -> None:
        free = 0
        while free < SENDERS and busy.acquire(blocking=False):
            free += 1
        taken: list[DeliveryRow] = []
        try:
            if free:
                taken = self.deliveries.take(
                    free,
                    without=receivers.without_room(),
                    room=receivers.room,
                    tenant_room=receivers.tenant_room,
                )
        finally:
            for _ in range(free - len(taken)):
                busy.release()
        for row in taken:
            receivers.begin(row.receiver, row.tenant)
            pool.submit(self._send_and_release, row, busy, receivers, wake)

    def _send_and_release(
        self, row: DeliveryRow, busy: threading.Semaphore, receivers: Receivers, wake: threading.Event
    ) -> None:
        is_failure = False
        try:
            is_failure = self.send(row) is DeliveryState.WAITING
        except Exception:
            log.exception("result of a webhook not stored", job_id=row.job_id, message=row.id)
        finally:
            receivers.end(row.receiver, row.tenant, is_failure=is_failure)
            busy.release()
            wake.set()

    def send(self, row: DeliveryRow) -> DeliveryState:
        """One attempt."""
        headers = signed_headers(row.id, row.body, self.deliveries.secrets(row.tenant), self.clock_ms())
        answer = self.poster.post(row.url, headers, row.body.encode())
        state = self.deliveries.note(row, answer)
        write = log.info if answer.is_accepted else log.warning
        facts = {"status": answer.status, "error": answer.error, "state": state.value}
        write("webhook", job_id=row.job_id, message=row.id, attempt=len(row.attempts) + 1, **facts)
        return state
