"""The caller of a request and its scopes: `caller: Reads` or `caller: Writes` among the arguments of a
handler.
"""

from collections.abc import Awaitable, Callable
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
    description="A key made by `cusp keys create`. A service without any key needs none.",
)


async def _authenticate(
    request: Request,
    api: UseApi,
    credentials: Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)],
) -> Caller:
    address = request.client.host if request.client else "unknown"
    caller = await api.callers.get("" if credentials is None else credentials.credentials)
    if caller is ANYBODY:
        api.rates.count(address)
        check_origin(request, allow_open=api.settings.allow_open)
        return ANYBODY
    api.rates.count(address if caller is None else f"key {caller.key_id}")
    if credentials is None:
        reason = (
            "the header Authorization has another form"
            if "authorization" in request.headers
            else "the header Authorization is missing"
        )
        raise Unauthorized(
            f"{reason}; send an API key as `Authorization: Bearer cusp_...` (`cusp keys create` makes keys)"
        )
    if caller is None:
        raise Unauthorized("the API key is unknown or revoked; ask the operator for another one")
    structlog.contextvars.bind_contextvars(tenant=caller.tenant, key_id=caller.key_id)
    return caller


def _with(scope: Scope) -> Callable[[Caller], Awaitable[Caller]]:
    async def caller(who: Annotated[Caller, Depends(_authenticate)]) -> Caller:
        if not who.may(scope):
            has = ", ".join(sorted(who.scopes)) or "none"
            raise Forbidden(
                f"this needs a key with the scope {scope}; the key {who.key_id} has {has}; "
                "ask the operator for another key"
            )
        return who

    return caller


Reads = Annotated[Caller, Depends(_with(Scope.READ))]
Admins = Annotated[Caller, Depends(_with(Scope.ADMIN))]
Writes = Annotated[Caller, Depends(_with(Scope.WRITE))]
