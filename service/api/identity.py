"""Which key came with a request, and may it do this: `caller: Reads` or `caller: Writes` in a handler's arguments."""

from collections.abc import Callable
from typing import Annotated

import structlog
from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from service.api.dependencies import UseApi
from service.auth.keys import ANYBODY, Caller, Scope
from service.auth.origins import check_origin
from service.contract.errors import Forbidden, Unauthorized

_bearer = HTTPBearer(
    auto_error=False,
    scheme_name="ApiKey",
    description="A key of `cusp keys create`. A service where none was ever made asks for none.",
)


def _who(
    request: Request, api: UseApi, given: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]
) -> Caller:
    address = request.client.host if request.client else "unknown"
    if not api.keys.are_asked_for():
        api.rates.count(address)
        check_origin(request, allow_open=api.settings.allow_open)
        return ANYBODY
    caller = None if given is None else api.keys.caller(given.credentials)
    api.rates.count(address if caller is None else f"key {caller.key_id}")
    if given is None:
        wrong = "it is of another form" if "authorization" in request.headers else "there is none"
        raise Unauthorized(
            f"send an API key as `Authorization: Bearer cusp_...`; {wrong} (`cusp keys create` makes keys)"
        )
    if caller is None:
        raise Unauthorized("the API key is not known here, or it was revoked; ask for another one")
    structlog.contextvars.bind_contextvars(tenant=caller.tenant, key_id=caller.key_id)
    return caller


def _with(scope: Scope) -> Callable[[Caller], Caller]:
    def caller(who: Annotated[Caller, Depends(_who)]) -> Caller:
        if not who.may(scope):
            has = ", ".join(sorted(who.scopes)) or "none"
            raise Forbidden(f"this needs a key with the scope {scope}; the key {who.key_id} has {has}")
        return who

    return caller


Reads = Annotated[Caller, Depends(_with(Scope.READ))]
Admins = Annotated[Caller, Depends(_with(Scope.ADMIN))]
Writes = Annotated[Caller, Depends(_with(Scope.WRITE))]
