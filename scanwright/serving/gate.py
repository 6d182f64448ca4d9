"""Access checks of a live page: of every request, and of every message before viser reads it.

Rejected are

- requests without the token, which is in the address and then in a cookie (HttpOnly, SameSite=Strict);
- another Host than this computer's, such as a name that resolves to 127.0.0.1 (DNS rebinding);
- another Origin than this page's, or requests that the browser marks as cross-site;
- every path but `/` and every query but the token;
- more than `MOST_VISITORS` connections; messages over `MOST_BYTES` (the library closes the connection);
- messages that the page does not need: uploads, viser's sharing over the internet, and malformed ones.
"""

from __future__ import annotations

import dataclasses
import math
import re
import secrets
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from html import escape
from http import HTTPStatus
from importlib.resources import files
from socket import socket
from typing import Any
from urllib.parse import parse_qsl, urlsplit

import msgspec
import viser.infra
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from scanwright.design.errors import TaskError
from scanwright.serving.handshake import MOST_VISITORS, bound, foreign, local_hosts, refusal
from scanwright.serving.last_address import save_address, saved_address

MOST_BYTES = 1 << 18  # of one message
MOST_TEXT = 200  # characters of a text, entries of a list
PAGE_MESSAGES = (
    "ViewerCameraMessage",
    "GuiUpdateMessage",
    "CommandTriggerMessage",
    "SceneNodeClickMessage",
    "SceneNodeDragMessage",
    "ScenePointerMessage",
)
KNOWN: dict[str, Any] = {
    kind.__name__: kind for kind in viser.infra.Message.get_subclasses() if kind.__name__ in PAGE_MESSAGES
}

ICON = (
    "data:image/svg+xml,%3Csvg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 32 32'%3E%3Crect width='32' height='32' "
    "rx='6' fill='%2300224e'/%3E%3Cpath d='M16 25 6 9a16 16 0 0 1 20 0z' fill='%23fee838'/%3E%3Ccircle cx='16' cy='25' "
    "r='3' fill='%23fff'/%3E%3C/svg%3E"
)

ADDED_TO_PAGE = (
    "viser_page.css",
    "viser_page.js",
    "fewer_points.js",
    "wall_pictures.js",
    "state_banner.js",
    "setting_link.js",
)

Answer = Callable[[ServerConnection, Request], Response | None]


class Gate:
    """The access checks of one page."""

    def __init__(self, port: int, title: str, *, recall: bool = False) -> None:
        self.title = title
        self.refused: Counter[str] = Counter()
        self.visitors = 0
        self.opened = False
        self.socket, self.token = _opened(port, recall)
        self.port: int = self.socket.getsockname()[1]
        if recall:
            save_address(self.port, self.token)
        self._cookie = f"scanwright-{self.port}"
        self._hosts = local_hosts(self.port)

    @property
    def address(self) -> str:
        """The address with its token."""
        return f"http://127.0.0.1:{self.port}/?token={self.token}"

    def objection(self, request: Request) -> str:
        """Return why a request is rejected; empty if it is accepted."""
        headers, parts = request.headers, urlsplit(request.path)
        origins = headers.get_all("Origin")
        talks = "websocket" in headers.get("Upgrade", "").lower() if len(headers.get_all("Upgrade")) < 2 else True
        query = parse_qsl(parts.query, keep_blank_values=True)
        tokens = [value for key, value in query if key == "token"]
        cookies = [value for key, value in _cookies(headers) if key == self._cookie]
        if why := foreign(headers, self._hosts, {f"http://{host}" for host in self._hosts}):
            return why
        if talks and len(origins) != 1:
            return "websocket without an origin"
        if any(site not in ("none", "same-origin") for site in headers.get_all("Sec-Fetch-Site")):
            return "cross-site"
        if not any(secrets.compare_digest(value.encode(), self.token.encode()) for value in tokens + cookies):
            return "no token"
        if request.path.startswith("//") or parts.path != "/" or [key for key, _ in query] not in ([], ["token"]):
            return "no such page"
        if talks and self.visitors >= MOST_VISITORS:
            return "too many visitors"
        return ""

    def answering(self, answer: Answer) -> Answer:
        """Return viser's `process_request` behind the checks."""

        def checked(connection: ServerConnection, request: Request) -> Response | None:
            if why := self.objection(request):
                self.refused[why] += 1
                missing = why == "no such page"
                status = HTTPStatus.NOT_FOUND if missing else HTTPStatus.FORBIDDEN
                return refusal(why, "open the address that scanwright printed", status)
            if "Accept-Encoding" in request.headers:
                del request.headers["Accept-Encoding"]  # an uncompressed page, to insert the title
            response = answer(connection, request)
            if response is not None:
                response.body = self._titled(bytes(response.body))
                del response.headers["Content-Length"]
                response.headers["Content-Length"] = str(len(response.body))
                for name, value in self._headers().items():
                    response.headers[name] = value
            return response

        return checked

    def _titled(self, page: bytes) -> bytes:
        """Return the page with our title, icon, style and scripts."""
        head, end, rest = page.partition(b"</title>")
        head = re.sub(rb"<title>.*", lambda _: f"<title>{escape(self.title)}".encode(), head, flags=re.DOTALL)
        head = re.sub(rb'href="data:image/svg\+xml,[^"]*"', lambda _: f'href="{ICON}"'.encode(), head)
        return head + end + _added_to_page() + rest

    def admits(self, data: str | bytes) -> bool:
        """Return whether a message is complete, known and of the right types."""
        try:
            message: Any = msgspec.msgpack.decode(data) if isinstance(data, bytes) else None
            kind = KNOWN[message.pop("type")]
            fits = set(message) <= {field.name for field in dataclasses.fields(kind)} and _tame(message)
            msgspec.convert(message, type=kind)
        except (msgspec.MsgspecError, KeyError, TypeError, AttributeError, RecursionError, ValueError):
            return False
        # viser would write any attribute of a control that a message names
        return fits and (kind is not KNOWN["GuiUpdateMessage"] or set(message["updates"]) == {"value"})

    def _headers(self) -> dict[str, str]:
        own = " ".join(f"ws://{host}" for host in sorted(self._hosts))
        policy = (
            "default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; style-src 'unsafe-inline'; "
            f"img-src data: blob:; font-src data:; worker-src blob:; connect-src 'self' data: blob: {own}; "
            "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        return {
            "Set-Cookie": f"{self._cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict",
            "Content-Security-Policy": policy,
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Cache-Control": "no-store",
        }


def _opened(port: int, recall: bool) -> tuple[socket, str]:
    """Return a socket and a token; with `recall` those of the last run if the port is free."""
    last = saved_address() if recall else None
    if last is not None and port in (0, last[0]):
        with suppress(TaskError):
            return bound(last[0]), last[1]
    return bound(port), secrets.token_urlsafe(24)


@cache
def _added_to_page() -> bytes:
    """Return the style and the scripts that are added to the page."""
    folder = files("scanwright.serving")
    style, *scripts = (folder.joinpath(name).read_bytes() for name in ADDED_TO_PAGE)
    return b"<style>" + style + b"</style>" + b"".join(b"<script>" + script + b"</script>" for script in scripts)


def _cookies(headers: Headers) -> list[tuple[str, str]]:
    pairs = (part.strip().partition("=") for line in headers.get_all("Cookie") for part in line.split(";"))
    return [(key, value) for key, _, value in pairs]


def _tame(value: Any) -> bool:
    """Return whether a message contains only finite numbers and short texts."""
    if isinstance(value, dict):
        return all(_tame(key) and _tame(inner) for key, inner in value.items())
    if isinstance(value, list):
        return len(value) <= MOST_TEXT and all(_tame(inner) for inner in value)
    if isinstance(value, str):
        return len(value) <= MOST_TEXT
    return value is None or (isinstance(value, bool | int | float) and math.isfinite(value) and abs(value) < 1e12)
