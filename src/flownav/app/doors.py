"""Who may ask: only requests to this machine by its name, with the token in their address, from no other page."""

from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from secrets import compare_digest
from typing import Any

Scope = MutableMapping[str, Any]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

NAMES = ("127.0.0.1", "localhost")
PAGE_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; style-src-attr 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# a written page has its own policy as well; in its sandbox it is nobody's origin, so that it can ask nothing of us
WRITTEN_POLICY = (
    "sandbox allow-scripts allow-downloads allow-popups; default-src 'none'; script-src 'unsafe-inline'; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; frame-ancestors 'none'"
)
HEADERS = {
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
}


class Doors:
    """An application behind its doors: `/TOKEN/x` is passed on as `/x`, anything else is refused with 403.

    port: which the requests must name, since a page of another name that leads to this machine is another's.
    """

    def __init__(self, inside: App, token: str, port: int) -> None:
        self.inside, self.token = inside, token
        self.hosts = {f"{name}:{port}" for name in NAMES}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] == "lifespan":
            await self.inside(scope, receive, send)
        elif scope["type"] == "http":
            why = self.why_refused(scope)
            if why:
                await _refuse(send, why)
            else:
                path = scope["path"].removeprefix(f"/{self.token}") or "/"
                await self.inside({**scope, "path": path, "raw_path": path.encode()}, receive, _with_headers(send))

    def why_refused(self, scope: Scope) -> str:
        """Why a request is refused, one line; "" where it may come in."""
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        if headers.get("host") not in self.hosts:
            return "this address is another's; open the one that flownav app printed"
        origin = headers.get("origin")
        if origin is not None and origin not in {f"http://{host}" for host in self.hosts}:
            return "another page may not ask here"
        if headers.get("sec-fetch-site") in ("cross-site", "same-site") and headers.get("sec-fetch-mode") != "navigate":
            return "another page may not ask here"
        first = scope["path"].split("/")[1]
        if not compare_digest(first.encode(), self.token.encode()):
            return "the token is missing; open the address that flownav app printed"
        return ""


def _with_headers(send: Send) -> Send:
    """Send with the headers that every answer has; a policy that the answer brings itself stays."""

    async def sent(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            there = {name.lower() for name, _ in message["headers"]}
            added = {**HEADERS, "content-security-policy": PAGE_POLICY}
            message["headers"] = [*message["headers"], *_encoded((k, v) for k, v in added.items()
                                                                 if k.encode() not in there)]  # fmt: skip
        await send(message)

    return sent


def _encoded(pairs: Iterable[tuple[str, str]]) -> list[tuple[bytes, bytes]]:
    return [(name.encode(), value.encode()) for name, value in pairs]


async def _refuse(send: Send, why: str) -> None:
    headers = _encoded([("content-type", "text/plain; charset=utf-8"), *HEADERS.items()])
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": f"flownav: {why}\n".encode()})
