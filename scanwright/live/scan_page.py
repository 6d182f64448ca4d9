"""The page of a scan in a process of its own, and the way to feed it: the scan must never wait for a browser."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

from design.angles import angles_in_use
from firmware_io.assembly.own_body import own_body_beside
from firmware_io.scan.live_feed import NOBODY, Feed, Placing, Watch, growing

ALONE_S = 10.0


@contextmanager
def live_page(folder: Path, *, wanted: bool) -> Iterator[Watch]:
    """What `acquire` tells of a scan: the page of a build folder's scanner, or nobody where it is not wanted.

    When the body has ended well, this waits until nobody looks any more.
    """
    if not wanted:
        yield NOBODY
        return
    spawn = get_context("spawn")
    receiving, sending = spawn.Pipe(duplex=False)
    page = spawn.Process(target=_show, args=(receiving, folder), daemon=True)
    page.start()
    receiving.close()
    yield Feed(sending)
    with suppress(KeyboardInterrupt):
        page.join()


def _show(receiving: Connection, folder: Path) -> None:
    """What the page's process does: show the cloud, and once it is full, wait until nobody looks at it."""
    from scanwright.live.cloud_view import CloudView
    from scanwright.serving.page_server import guarded_server, wait_until_alone

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the scan, and that ends this
    in_use = angles_in_use(folder)
    placing = Placing(in_use.angles, own_body_beside(in_use.path))
    with guarded_server(f"Scanwright: scan of {folder.name}") as (server, gate):
        view = CloudView(server)
        print(f"open {gate.address}", flush=True)
        for growth in growing(receiving, placing):
            view.add(growth)
        view.tell("the scan is done; this page ends when you close it")
        if gate.visitors:
            wait_until_alone(gate, ALONE_S)
