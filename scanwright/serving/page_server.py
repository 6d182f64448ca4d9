"""The server of a live page: that of viser, opened here on 127.0.0.1 with a `Gate` for each connection."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Any

import rich
import viser
import websockets.asyncio.server as library
from websockets.asyncio.server import ServerConnection

from scanwright.serving.gate import MOST_BYTES, Answer, Gate

BRAND = (35, 77, 140)  # dark blue, readable under white text


@contextmanager
def guarded_server(title: str, port: int = 0, *, recall: bool = False) -> Iterator[tuple[viser.ViserServer, Gate]]:
    """Run a viser server behind a gate while the body runs, on a port of 127.0.0.1 (0 chooses a free one).

    With `recall` it uses port and token of the last run, so that links still work.

    Raises:
        TaskError: the port is taken.
    """
    gate = Gate(port, title, recall=recall)
    rich.get_console().quiet = True  # viser prints an address without the token
    # viser 1.1 accepts a host and a port (`ViserServer`, `viser.infra.WebsockServer`), but no socket and no check
    opening = library.serve
    library.serve = _opening(gate, opening)  # type: ignore[assignment, misc]
    try:
        server = viser.ViserServer(host="127.0.0.1", port=gate.port, verbose=False)
    finally:
        library.serve = opening  # type: ignore[misc]
    if not gate.opened:  # another version of viser, which would serve without the checks
        server.stop()
        raise RuntimeError("viser did not open its server through websockets.asyncio.server.serve")
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large", brand_color=BRAND)
    server.gui.set_panel_label(title)
    try:
        yield server, gate
    finally:
        server.stop()
        gate.socket.close()


def _opening(gate: Gate, opening: Callable[..., Any]) -> Callable[..., Any]:
    """Return the `websockets.asyncio.server.serve` that viser calls."""

    class Guarded(ServerConnection):
        async def recv(self, decode: bool | None = None) -> Any:
            while True:
                data = await super().recv(decode)
                if gate.admits(data):
                    return data
                gate.refused["unknown message"] += 1

    def serve(
        handler: Callable[[ServerConnection], Awaitable[None]],
        _host: str,
        _port: int,
        *,
        process_request: Answer,
        **options: Any,
    ) -> Any:
        async def counted(connection: ServerConnection) -> None:
            gate.visitors += 1
            try:
                await handler(connection)
            finally:
                gate.visitors -= 1

        gate.opened = True
        return opening(
            counted,
            sock=gate.socket,
            process_request=gate.answering(process_request),
            create_connection=Guarded,
            **(options | {"max_size": MOST_BYTES}),
        )

    return serve


def wait_until_alone(gate: Gate, alone_s: float) -> None:
    """Return when no page has been open for `alone_s`."""
    seen_s = time.monotonic()
    while time.monotonic() - seen_s < alone_s:
        time.sleep(min(0.5, alone_s / 4))
        if gate.visitors:
            seen_s = time.monotonic()
