"""Checks of a request by Host and Origin, headers that a page cannot choose, and the socket of a server.

A browser lets any page open a websocket to this computer; Host differs after DNS rebinding.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Container, Iterable
from http import HTTPStatus

from websockets.datastructures import Headers
from websockets.http11 import Response

from scanwright.design.errors import TaskError

MOST_VISITORS = 8  # connections at once

_ORIGIN = re.compile(r"[a-z][a-z0-9+.-]*://[a-z0-9.:\[\]-]+")


def local_hosts(port: int) -> set[str]:
    """Return the Host headers that name a port of this computer."""
    return {f"127.0.0.1:{port}", f"localhost:{port}"}


def foreign(headers: Headers, hosts: Container[str], origins: Container[str]) -> str:
    """Return "foreign host" or "foreign origin" for such a request, else an empty string.

    A request without an Origin is accepted, since it does not come from a script of a page.
    """
    named = headers.get_all("Host")
    if len(named) != 1 or named[0] not in hosts:
        return "foreign host"
    return "" if all(origin in origins for origin in headers.get_all("Origin")) else "foreign origin"


def refusal(why: str, hint: str, status: HTTPStatus = HTTPStatus.FORBIDDEN) -> Response:
    """Return the response to a rejected request."""
    text = f"refused: {why}; {hint}\n".encode()
    headers = Headers({"Content-Type": "text/plain", "Content-Length": str(len(text))})
    return Response(status.value, status.phrase, headers, text)


def bound(port: int) -> socket.socket:
    """Return a socket on a port of 127.0.0.1; 0 is any free one.

    Raises:
        TaskError: the port is taken.
    """
    # with the protocol named, asyncio sends small messages at once; otherwise each waits 40 ms for a receipt
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind(("127.0.0.1", port))
    except (OSError, OverflowError) as error:
        listening.close()
        why = error.strerror.lower() if isinstance(error, OSError) and error.strerror else "no such port"
        raise TaskError(f"port = {port}: {why}; 0 chooses any free port") from error
    return listening


def as_origins(texts: Iterable[str] | None) -> tuple[str, ...]:
    """Return the origins that a person allows, as browsers send them.

    Raises:
        TaskError: one is not the origin of a page; any page can send `null`.
    """
    origins = tuple(text.lower().removesuffix("/") for text in texts or ())
    for origin in origins:
        if not _ORIGIN.fullmatch(origin):
            raise TaskError(f"allow_origin = {origin}: not an origin (allowed SCHEME://HOST[:PORT])")
    return origins
