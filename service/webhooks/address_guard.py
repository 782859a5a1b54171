"""Addresses that webhooks and meshes by URL may reach. Clients choose them, so internal services must be
protected (SSRF).

`check_url` checks the URL that a client sends, `check` the IP address that `http_client` then connects to.
"""

import socket
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address, ip_network
from urllib.parse import urlsplit

Network = IPv4Network | IPv6Network
_NAT64 = IPv6Network("64:ff9b::/96")  # IPv4 through IPv6: checked by the embedded address
_GLOBAL_UNICAST = IPv6Network("2000::/3")  # other IPv6 addresses are local, reserved or embed IPv4


class ForbiddenAddress(Exception):
    """An address that webhooks must not reach."""


@dataclass(frozen=True, slots=True)
class Guard:
    """allowed : networks that may be reached although they are not public; setting : names them"""

    allowed: tuple[Network, ...] = ()
    setting: str = "CUSP_WEBHOOK_NETWORKS"

    @classmethod
    def of(cls, networks: str, setting: str = "CUSP_WEBHOOK_NETWORKS") -> "Guard":
        """`10.1.0.0/16, fd00::/8`. Raises ValueError."""
        return cls(tuple(ip_network(word.strip()) for word in networks.split(",") if word.strip()), setting)

    def check_url(self, url: str) -> None:
        """Check a URL without a name look-up. Raises ForbiddenAddress."""
        try:
            parts = urlsplit(url)
            host, _ = parts.hostname, parts.port
        except ValueError as error:
            raise ForbiddenAddress(f"is not a URL ({error})") from error
        if parts.scheme not in ("http", "https") or not host:
            raise ForbiddenAddress("must be http://host/path or https://host/path")
        if parts.username is not None or parts.password is not None:
            raise ForbiddenAddress("must not hold a user name or a password")
        if not url.isascii() or any(each <= " " or each == "\x7f" for each in url):
            raise ForbiddenAddress("must be plain ASCII without spaces; encode the rest with %")
        name = host.removesuffix(".")
        if name == "localhost" or name.endswith(".localhost"):
            self.check("localhost", ip_address("127.0.0.1"))
        if (address := _literal(name)) is not None:
            self.check(host, address)
        # a name is checked when it is resolved

    def check(self, host: str, address: IPv4Address | IPv6Address) -> None:
        """Raise ForbiddenAddress unless the address is public or allowed."""
        for each in (address, *_embedded(address)):
            if any(each.version == network.version and each in network for network in self.allowed):
                continue
            if not _is_public(each):
                raise ForbiddenAddress(
                    f"{host} is not a public address ({each}); the operator can allow its network "
                    f"by {self.setting}"
                )


def _literal(host: str) -> IPv4Address | IPv6Address | None:
    """The address that a host is, also in legacy forms (127.1, 2130706433, 0x7f.1); None for a name."""
    try:
        return ip_address(host)
    except ValueError:
        pass
    try:
        return IPv4Address(socket.inet_aton(host))
    except OSError:
        return None


def _is_public(address: IPv4Address | IPv6Address) -> bool:
    if isinstance(address, IPv6Address) and address not in _GLOBAL_UNICAST:
        return address in _NAT64
    return address.is_global and not address.is_multicast


def _embedded(address: IPv4Address | IPv6Address) -> list[IPv4Address]:
    """IPv4 addresses embedded in an IPv6 address."""
    if isinstance(address, IPv4Address):
        return []
    embedded = [address.ipv4_mapped, address.sixtofour, address.teredo[1] if address.teredo else None]
    if address in _NAT64:
        embedded.append(IPv4Address(int(address) & 0xFFFFFFFF))
    return [each for each in embedded if each is not None]
