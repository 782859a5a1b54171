"""The webhook of a job: its address is checked before the job is stored."""

from service.contract.errors import InvalidOptions
from service.contract.options import problem_item, summarize
from service.contract.schemas import Options
from service.webhooks.address_guard import ForbiddenAddress, Guard


def check_webhook(options: Options, guard: Guard) -> None:
    """Refuse an address that webhooks may not reach. Raises InvalidOptions."""
    if options.webhook is None:
        return
    try:
        guard.check_url(options.webhook.url)
    except ForbiddenAddress as error:
        item = problem_item("/options/webhook/url", str(error))
        raise InvalidOptions(summarize([item]), errors=[item]) from error
