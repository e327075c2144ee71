"""Access control of a page: checks of a request's Host, Origin and token, and the headers of every response.

A page of another site that is open in the same browser can send requests to this machine. Two checks keep it out. A
WebSocket must come from the page that this server served (Origin). And the server must be addressed by a name that
nobody else can point at it (Host): a numeric address, localhost, or this machine's name. A DNS name can be made to
point anywhere (DNS rebinding).
"""

import hmac
import ipaddress
import re
import secrets
import socket
from contextlib import suppress

from thenar.drivers.errors import SettingError

# Too many to try; tokens made here have 32.
LEAST_TOKEN = 16
_TOKEN = re.compile(rf"[A-Za-z0-9_-]{{{LEAST_TOKEN},128}}")
_HOST = re.compile(r"(?:\[([0-9A-Fa-f:.]+)\]|([^][:/@\s]+))(?::[0-9]{1,5})?")

# What the browser may do with a page: only what is listed. Nothing inline, no other site, no frame around it; and no
# text becomes markup in a script (Trusted Types).
POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
        "trusted-types 'none'",
    )
)
HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
    "Server": "thenar",
}


def new_token() -> str:
    """Return a token of 192 random bits."""
    return secrets.token_urlsafe(24)


class Guard:
    """Decides which requests are served.

    The token comes once, in the address that the user opens. The server replies with a cookie and redirects to an
    address without it, so that it is neither in the browser's history nor on the screen. The cookie holds another
    secret, which expires with the server.

    Parameters
    ----------
    name : str
        The host in the address that the server was given.
    address : str
        The IP address at which it listens, and `port` there.
    port : int
        Cookies are sent to all ports of a host, so its name has the port.
    token : str or None
        The secret that a user must know. None: nothing, which only a loopback address allows.

    Raises
    ------
    SettingError
        For an address that others can reach without a token, and for a token that can be guessed.
    """

    def __init__(self, name: str, address: str, port: int, token: str | None) -> None:
        self._loopback = ipaddress.ip_address(address.partition("%")[0]).is_loopback
        if token is None and not self._loopback:
            raise SettingError(
                f"{name} is an address that other machines can reach: add --web-token, so that only those who know the "
                "address with its token see the page, or use 127.0.0.1"
            )
        if token is not None and not _TOKEN.fullmatch(token):
            raise SettingError(f"a token must have {LEAST_TOKEN} to 128 random letters, digits, - or _")
        self._token = token
        self._names = {name.lower(), "localhost"}
        if not self._loopback:
            own = socket.gethostname().lower()
            self._names |= {own, f"{own.partition('.')[0]}.local"}
        self.cookie, self.secret = f"thenar-{port}", new_token()

    def knows_host(self, host: str) -> bool:
        """Return whether a Host header is one that no other site can have."""
        found = _HOST.fullmatch(host)
        if found is None:
            return False
        name = (found[1] or found[2]).lower().rstrip(".")
        with suppress(ValueError):
            address = ipaddress.ip_address(name)
            return address.is_loopback or not self._loopback
        return name in self._names

    def same_origin(self, origin: str | None, host: str) -> bool:
        """Return whether a WebSocket request names this server's page as its origin; one without origin is rejected."""
        return origin in (f"http://{host}", f"https://{host}")

    def takes_token(self, token: str | None) -> bool:
        """Return whether this is the token, in equal time for all tokens of the same length."""
        return self._token is not None and token is not None and _same(token, self._token)

    def lets_in(self, cookie: str | None) -> bool:
        """Return whether a request needs no token, or has shown it before."""
        return self._token is None or (cookie is not None and _same(cookie, self.secret))


def _same(given: str, secret: str) -> bool:
    return hmac.compare_digest(given.encode(errors="backslashreplace"), secret.encode())
