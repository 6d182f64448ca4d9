"""A server of Foxglove's websocket protocol, `foxglove.sdk.v1`, for programs and allowed pages of this computer.

The server of Foxglove's SDK checks no Origin, so that any page of the browser could read a scan.
Protocol: https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md.
"""

from __future__ import annotations

import asyncio
import json
import logging
import struct
import time
from collections import deque
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from operator import index
from threading import Event, Thread
from typing import Any
from urllib.parse import quote

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response
from websockets.typing import Subprotocol

from scanwright.design.progress import Progress
from scanwright.serving.handshake import MOST_VISITORS, bound, foreign, local_hosts, refusal

_LOG = logging.getLogger(__name__)

SUBPROTOCOL = Subprotocol("foxglove.sdk.v1")
APP = "https://app.foxglove.dev"
FOXGLOVE = (APP, "https://studio.foxglove.dev", "file://")  # the desktop application sends file://, a browser null

BACKLOG = 4096  # messages that a slow viewer may be behind; the oldest are dropped beyond
_MOST_BYTES = 1 << 16  # of a message from a client: subscriptions are short
_MOST_SUBSCRIPTIONS = 64  # of a client
_MOST_REFUSALS = 20  # lines of different refusals
_FLUSH_S = 2.0  # at the end, for what clients have not yet taken


@dataclass(eq=False, slots=True)
class _Client:
    """A viewer: number of each subscription -> topic, and the messages to send."""

    topics: dict[int, str] = field(default_factory=dict)
    waiting: deque[bytes] = field(default_factory=lambda: deque(maxlen=BACKLOG))
    ready: asyncio.Event = field(default_factory=asyncio.Event)

    def receive(self, text: str | bytes, topics: tuple[str, ...]) -> None:
        """Handle a message of the client; malformed and unknown ones are dropped."""
        with suppress(ValueError, TypeError, KeyError, IndexError, RecursionError):
            message: Any = json.loads(text) if isinstance(text, str) else {}
            if message["op"] == "subscribe":
                for one in message["subscriptions"]:
                    number, channel = index(one["id"]), index(one["channelId"])
                    if 0 <= number < 2**32 and channel > 0 and len(self.topics) < _MOST_SUBSCRIPTIONS:
                        self.topics[number] = topics[channel - 1]
            elif message["op"] == "unsubscribe":
                for number in message["subscriptionIds"]:
                    self.topics.pop(number, None)


class FoxgloveServer:
    """A server that sends messages to all subscribers; made by `foxglove_server`."""

    def __init__(
        self,
        name: str,
        channels: Mapping[str, tuple[str, str]],
        port: int,
        origins: Collection[str],
    ) -> None:
        """Bind the port; arguments as for `foxglove_server`."""
        self._socket = bound(port)
        self.port: int = self._socket.getsockname()[1]
        self._topics, self._origins = tuple(channels), frozenset(origins)
        self._loop = asyncio.new_event_loop()
        self._clients: set[_Client] = set()
        self._ended = asyncio.Event()
        self._refused = set[str]()
        about = {"name": name, "capabilities": [], "metadata": {}, "sessionId": str(time.time_ns() // 10**6)}
        encoded = {"encoding": "cdr", "schemaEncoding": "ros2msg"}
        described = [
            {"id": number, "topic": topic, "schemaName": kind, "schema": definition} | encoded
            for number, (topic, (kind, definition)) in enumerate(channels.items(), 1)
        ]
        self._greeting = [
            json.dumps({"op": "serverInfo"} | about),
            json.dumps({"op": "advertise", "channels": described}),
        ]

    @property
    def address(self) -> str:
        """The address for a viewer."""
        return f"ws://127.0.0.1:{self.port}"

    @property
    def app_url(self) -> str:
        """The address of Foxglove's page that opens this server."""
        return f"{APP}?ds=foxglove-websocket&ds.url={quote(self.address, safe='')}"

    @property
    def has_subscribers(self) -> bool:
        """Whether any viewer has subscribed to a topic."""
        return any(client.topics for client in tuple(self._clients))

    def log(self, topic: str, data: bytes, time_ns: int) -> None:
        """Send a message to the subscribers of its topic, without waiting for them."""
        self._loop.call_soon_threadsafe(self._publish, topic, data, time_ns)

    def _publish(self, topic: str, data: bytes, time_ns: int) -> None:
        for client in self._clients:
            for number, wanted in client.topics.items():
                if wanted == topic:
                    client.waiting.append(struct.pack("<BIQ", 1, number, time_ns) + data)
                    client.ready.set()

    def check(self, _connection: ServerConnection, request: Request) -> Response | None:
        """Refuse the handshake of a foreign page or of too many viewers; None accepts it."""
        why = foreign(request.headers, local_hosts(self.port), self._origins)
        if not why and len(self._clients) >= MOST_VISITORS:
            why = "too many visitors"
        if not why:
            return None
        origin = request.headers.get_all("Origin")[:1]
        line = f"refused a viewer: {why}" + (f" {origin[0][:100]!r}" if why == "foreign origin" else "")
        if line not in self._refused and len(self._refused) < _MOST_REFUSALS:  # a page may repeat it
            self._refused.add(line)
            _LOG.warning(line)
        return refusal(why, "to allow a page, start scanwright with --allow-origin ORIGIN")

    async def _serve_client(self, connection: ServerConnection) -> None:
        client = _Client()
        self._clients.add(client)
        sending = asyncio.create_task(self._send(connection, client))
        try:
            with suppress(ConnectionClosed):
                for text in self._greeting:
                    await connection.send(text)
                async for message in connection:
                    client.receive(message, self._topics)
        finally:
            self._clients.discard(client)
            sending.cancel()

    async def _send(self, connection: ServerConnection, client: _Client) -> None:
        with suppress(ConnectionClosed):
            while await client.ready.wait():
                while client.waiting:
                    await connection.send(client.waiting.popleft())
                client.ready.clear()

    async def _run(self, opened: Event) -> None:
        async with serve(
            self._serve_client,
            sock=self._socket,
            process_request=self.check,
            subprotocols=[SUBPROTOCOL],
            compression=None,
            max_size=_MOST_BYTES,
        ):
            opened.set()
            await self._ended.wait()
            until_s = self._loop.time() + _FLUSH_S
            while any(client.waiting for client in self._clients) and self._loop.time() < until_s:
                await asyncio.sleep(0.02)

    @contextmanager
    def running(self) -> Iterator[None]:
        """Serve while the body runs, in a thread of its own."""
        opened = Event()
        thread = Thread(target=self._loop.run_until_complete, args=[self._run(opened)], name="foxglove", daemon=True)
        thread.start()
        opened.wait()
        try:
            yield
        finally:
            self._loop.call_soon_threadsafe(self._ended.set)
            thread.join()
            self._loop.close()


@contextmanager
def foxglove_server(
    name: str,
    channels: Mapping[str, tuple[str, str]],
    port: int,
    progress: Progress,
    allow_origins: Collection[str] = (),
) -> Iterator[FoxgloveServer]:
    """Serve channels to Foxglove while the body runs.

    Raises:
        TaskError: the port is taken.
    """
    server = FoxgloveServer(name, channels, port, {*FOXGLOVE, *allow_origins})
    with server.running():
        progress(f"open {server.address} in Foxglove, or {server.app_url}")
        yield server
