"""The life of a live page: it opens, says its address, and ends when its last visitor has been gone for a while."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Protocol

from design.task.task import LoadedTask
from scanwright.live.gate import Gate, guarded_server
from scanwright.live.page import Float32s, LiveView
from scanwright.studio.page import Studio
from scanwright.studio.view.workbench import Workbench

ALONE_S = 300.0
LIVE_ALONE_S = 10.0


def run_studio(
    loaded: LoadedTask, bench: Workbench, *, port: int, out: Path, say: Callable[[str], None], alone_s: float = ALONE_S
) -> None:
    """Serve the studio of a task until nobody has looked at it for `alone_s`.

    Task files are saved to the folder that this was started in.

    Raises:
        TaskError: the port is taken, or the task has no region.
    """
    with guarded_server(port) as (server, gate):
        say("reading the task (the first run compiles the numerics: some 20 s)")
        studio = Studio(server, loaded, bench, Path.cwd(), out)
        try:
            print(f"open {gate.address}", flush=True)
            print(f"Ctrl-C ends it; without a visitor it ends by itself after {alone_s / 60:g} minutes", flush=True)
            wait_until_alone(gate, alone_s)
        finally:
            studio.close()
        for why, count in gate.refused.items():
            say(f"refused {count:,}: {why}")


class Growth(Protocol):
    """By what a cloud has grown; see `firmware_io.scan.live_feed.Growth`."""

    @property
    def points_m(self) -> Float32s:
        """New points in the world, shape (n, 3)."""

    @property
    def intensity(self) -> Float32s:
        """Shape (n,)."""

    @property
    def time_s(self) -> Float32s:
        """Since the first scan, shape (n,)."""

    @property
    def lines(self) -> tuple[str, ...]:
        """What the scan said meanwhile."""

    @property
    def lost(self) -> int:
        """Scans that the view left out so far."""


def run_live(growth: Iterable[Growth], title: str, *, alone_s: float = LIVE_ALONE_S) -> None:
    """Show a cloud while it grows; when it is full, until nobody has looked at it for `alone_s`."""
    with guarded_server() as (server, gate):
        view = LiveView(server, title)
        print(f"open {gate.address}", flush=True)
        for more in growth:
            view.lost = more.lost
            view.add(more.points_m, more.intensity, more.time_s)
            for line in more.lines:
                view.tell(line)
        view.tell("the scan is done; this page ends when you close it")
        if gate.visitors:
            wait_until_alone(gate, alone_s)


def wait_until_alone(gate: Gate, alone_s: float) -> None:
    """Return when no page has been open for that long."""
    seen_s = time.monotonic()
    while time.monotonic() - seen_s < alone_s:
        time.sleep(min(0.5, alone_s / 4))
        if gate.visitors:
            seen_s = time.monotonic()
