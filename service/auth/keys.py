"""API keys: who may do what, for whom. Only a hash of a key's secret is stored; the key itself is shown once.

A service without any key needs none and has one tenant. From the first key on, every request needs one, also
after the last key is revoked.
"""

import hashlib
import hmac
import re
import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from sqlalchemy import JSON, BigInteger, Engine, String, select, update
from sqlalchemy.orm import Mapped, mapped_column, sessionmaker

from service.jobs.models import DEFAULT_TENANT, Base, now_ms
from service.settings import ServiceSettings

PREFIX = "cusp"
TENANT = re.compile(r"[a-z0-9][a-z0-9_.-]{0,63}")


class Scope(StrEnum):
    """What a key allows; `admin` includes the others."""

    WRITE = "jobs:write"
    READ = "jobs:read"
    ADMIN = "admin"


@dataclass(frozen=True, slots=True)
class Caller:
    """The caller of a request. key_id : None if the service needs no key"""

    tenant: str
    scopes: frozenset[Scope]
    key_id: str | None

    def may(self, scope: Scope) -> bool:
        return scope in self.scopes or Scope.ADMIN in self.scopes


#: The caller of a service without keys.
ANYBODY = Caller(DEFAULT_TENANT, frozenset(Scope), None)


class KeyRow(Base):
    """A key. Its secret has 256 random bits, so a plain SHA-256 of it is safe to store."""

    __tablename__ = "api_keys"

    id: Mapped[str] = mapped_column(String(16), primary_key=True)
    tenant: Mapped[str] = mapped_column(String(64))
    scopes: Mapped[list[str]] = mapped_column(JSON)
    name: Mapped[str] = mapped_column(String(200))
    secret_sha256: Mapped[str] = mapped_column(String(64))
    created_ms: Mapped[int] = mapped_column(BigInteger)
    revoked_ms: Mapped[int | None] = mapped_column(BigInteger)


class BadTenant(ValueError):
    """An invalid name of a tenant."""


class Exposed(Exception):
    """Other machines could reach the service without a key."""


class KeyStore:
    """The keys of one database. Safe to share between threads."""

    def __init__(self, engine: Engine, clock_ms: Callable[[], int] = now_ms) -> None:
        self._session = sessionmaker(engine, expire_on_commit=False)
        self._clock_ms = clock_ms

    def create(self, tenant: str, scopes: Sequence[Scope], name: str = "") -> tuple[KeyRow, str]:
        """Create a key. Returns its row and its text, which is shown this once only.

        Raises
        ------
        BadTenant
        """
        if not TENANT.fullmatch(tenant):
            raise BadTenant(
                f"tenant {tenant!r}: must be up to 64 lower-case letters, digits and . _ -, "
                "beginning with a letter or digit"
            )
        key_id, secret = secrets.token_hex(6), secrets.token_urlsafe(32)
        row = KeyRow(
            id=key_id,
            tenant=tenant,
            scopes=sorted(scopes),
            name=name,
            secret_sha256=_hash(secret),
            created_ms=self._clock_ms(),
        )
        with self._session.begin() as session:
            session.add(row)
        return row, f"{PREFIX}_{key_id}_{secret}"

    def all(self) -> Sequence[KeyRow]:
        """Every key that was made, revoked ones too, oldest first."""
        with self._session() as session:
            return session.scalars(select(KeyRow).order_by(KeyRow.created_ms, KeyRow.id)).all()

    def revoke(self, key_id: str) -> bool:
        """Revoke a key. False if it does not exist or was revoked before."""
        with self._session.begin() as session:
            done = session.execute(
                update(KeyRow)
                .where(KeyRow.id == key_id, KeyRow.revoked_ms.is_(None))
                .values(revoked_ms=self._clock_ms())
                .returning(KeyRow.id)
            )
            return done.scalar_one_or_none() is not None

    def are_required(self) -> bool:
        """True if any key exists, revoked ones included."""
        with self._session() as session:
            return session.scalar(select(KeyRow.id).limit(1)) is not None

    def callers(self, keys: Sequence[str]) -> dict[str, Caller]:
        """The callers with these keys, without those that are unknown or revoked.

        Everybody is ANYBODY as long as no key exists.
        """
        if not self.are_required():
            return dict.fromkeys(keys, ANYBODY)
        known = {key: parts for key in keys if (parts := _parts(key)) is not None}
        if not known:
            return {}
        with self._session() as session:
            query = select(KeyRow).where(KeyRow.id.in_({key_id for key_id, _ in known.values()}))
            rows = {row.id: row for row in session.scalars(query)}
        found = {key: _caller(rows.get(key_id), secret) for key, (key_id, secret) in known.items()}
        return {key: caller for key, caller in found.items() if caller is not None}

    def caller(self, key: str) -> Caller | None:
        """The caller with this key; None if it is unknown or revoked."""
        return self.callers([key]).get(key)


def _parts(key: str) -> tuple[str, str] | None:
    """The id and the secret of a key; None if it has another form."""
    prefix, _, rest = key.partition("_")
    key_id, _, secret = rest.partition("_")
    return (key_id, secret) if prefix == PREFIX and "\0" not in key_id else None


def _caller(row: KeyRow | None, secret: str) -> Caller | None:
    is_right = hmac.compare_digest(_hash(secret), row.secret_sha256 if row else _hash(""))
    if row is None or not is_right or row.revoked_ms is not None:
        return None
    return Caller(row.tenant, frozenset(Scope(scope) for scope in row.scopes), row.id)


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def check_exposure(settings: ServiceSettings, keys: KeyStore) -> None:
    """Refuse to listen beyond loopback without keys.

    Raises
    ------
    Exposed
    """
    if settings.is_exposed and not keys.are_required():
        raise Exposed(
            f"host {settings.host} is reachable from other machines and there are no API keys; make one by "
            "`cusp keys create --tenant NAME`, listen on 127.0.0.1, or set CUSP_ALLOW_OPEN=1 (--allow-open) "
            "if a firewall or a proxy guards it"
        )
