"""Access control: roles, tokens and origin checks."""

from __future__ import annotations

import hmac
import re
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from urllib.parse import urlsplit

from companion.flight.dashboard.security.address import Address
from companion.runtime.errors import UsageError

COOKIE = "slz-token"
LEAST_CHARACTERS = 16
_LINE = re.compile(r"(operator|viewer)\s+([A-Za-z0-9_-]+)")


class Role(Enum):
    """Permission of a browser."""

    VIEWER = "viewer"
    OPERATOR = "operator"


def read_tokens(path: Path) -> dict[str, Role]:
    """Return the tokens of a file: lines `operator TOKEN` or `viewer TOKEN`.

    Raises
    ------
    UsageError
        The file cannot be read, others than its owner may read it, or a line is neither.
    """
    what = f"--dashboard-token {path}"
    try:
        text = path.read_text("utf-8")
        if path.stat().st_mode & 0o077:
            raise UsageError(f"{what} can be read by others: chmod 600 it")
    except (OSError, UnicodeDecodeError) as error:
        raise UsageError(f"{what} cannot be read: {error}") from None
    tokens: dict[str, Role] = {}
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        found = _LINE.fullmatch(line.strip())
        if found is None or len(found[2]) < LEAST_CHARACTERS:
            raise UsageError(
                f"{what}, line {number}: write 'operator TOKEN' or 'viewer TOKEN', a token having"
                f" {LEAST_CHARACTERS} or more letters, digits, - or _"
            )
        tokens[found[2]] = Role(found[1])
    if not tokens:
        raise UsageError(f"{what} holds no token")
    return tokens


class Access:
    """Decides from a request's headers and token, without I/O.

    Without tokens, which only a loopback address allows, everybody who reaches the page is the operator. The
    Host header must then be this computer's own, or a foreign web page could direct a browser here under its
    own name (DNS rebinding).

    Raises
    ------
    UsageError
        Others can reach the address and there is no token.
    """

    def __init__(self, address: Address, tokens: Mapping[str, Role] | None) -> None:
        if not tokens and not address.is_loopback:
            raise UsageError(
                f"--dashboard {address}: others reach this address, so it needs --dashboard-token FILE with"
                " lines 'operator TOKEN' and 'viewer TOKEN'"
            )
        self._tokens = dict(tokens or {})
        self._own = {f"{host}:{address.port}" for host in ("127.0.0.1", "localhost", "[::1]", address.host)}

    @property
    def needs_token(self) -> bool:
        """True if a token is needed."""
        return bool(self._tokens)

    def role(self, token: str | None) -> Role | None:
        """Return the role of a token, None if it is unknown; compared in constant time."""
        if not self._tokens:
            return Role.OPERATOR
        given = (token or "").encode()
        found = None
        for known, role in self._tokens.items():
            if hmac.compare_digest(known.encode(), given):
                found = role
        return found

    def refuses(self, headers: Mapping[str, str], *, acts: bool) -> str:
        """Return the reason to refuse a request whatever its token, empty if there is none.

        acts: the request changes something or opens a channel for orders, so it must prove that it comes from
        this page.
        """
        host = headers.get("host", "")
        if not self._tokens and host not in self._own:
            return f"ask for this page as one of {', '.join(sorted(self._own))}"
        if headers.get("sec-fetch-site", "none") not in ("same-origin", "none"):
            if headers.get("sec-fetch-mode") == "navigate" and not acts:
                return ""  # a link to this page
            return "asked by another site's page"
        origin = headers.get("origin")
        if origin is None:
            return "no Origin" if acts else ""
        return "" if _named(origin) == host else "asked by another site's page"


def _named(origin: str) -> str | None:
    """Return host and port of an origin, None if it is invalid."""
    try:
        return urlsplit(origin).netloc or None
    except ValueError:
        return None
