"""The webhook of a job: its address is checked before the job is stored."""

from service.contract.errors import InvalidOptions
from service.contract.invalid_values import problem_item
from service.contract.options import summarize
from service.contract.schemas import Options
from service.webhooks.address_guard import ForbiddenAddress, Guard


def check_webhook(options: Options, guard: Guard) -> None:
    """Refuse an address that webhooks may not reach. Raises InvalidOptions."""
    if options.webhook is not None:
        check_webhook_url(options.webhook.url, "/options/webhook/url", guard)


def check_webhook_url(url: str, pointer: str, guard: Guard) -> None:
    """The same for the value at `pointer` of a request."""
    try:
        guard.check_url(url)
    except ForbiddenAddress as error:
        item = problem_item(pointer, str(error))
        raise InvalidOptions(summarize([item]), errors=[item]) from error
