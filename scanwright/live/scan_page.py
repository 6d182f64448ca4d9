"""The page of a scan, in a separate process so that the scan never waits for a browser.

The page is served before any device is opened, so that it shows the first scan.
"""

from __future__ import annotations

import logging
import signal
import sys
import time
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import numpy as np

from scanwright.design.angles import AngleSet, angles_in_use
from scanwright.design.errors import ScanwrightError
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.self_occlusion import load_self_occlusion
from scanwright.design.task.task import load_task
from scanwright.firmware_io.assembly.own_body import own_body_of
from scanwright.firmware_io.scan.live_feed import UNWATCHED, Feed, Placing, Viewer, growing
from scanwright.firmware_io.scan.scan_end import LOST
from scanwright.report.colours import bands_to

if TYPE_CHECKING:
    from scanwright.live.cloud_view import CloudView

_LOG = logging.getLogger(__name__)
ALONE_S = 10.0  # without a visitor; a page that is reloaded returns sooner
SERVED_S = 60.0  # at most until the page is served, on a computer that has much else to do
_CLOSED_S = 1.0  # for the page to end if no browser is connected
EXPECTED_OPACITY = 0.6
OPENED_S = 15.0  # at most until the browser has it


@contextmanager
def live_page(folder: Path, *, wanted: bool, browse: Callable[[str], object] | None = None) -> Iterator[Viewer]:
    """Serve the page of a build folder's scanner while the body runs; nothing if it is not wanted.

    After the end of the scan this waits until no page is open, or for Ctrl-C. `browse` opens an address; None is the
    default browser, on a terminal only.

    Raises:
        ScanwrightError: the page cannot be served.
    """
    if not wanted:
        yield UNWATCHED
        return
    spawn = get_context("spawn")
    receiving, sending = spawn.Pipe(duplex=False)
    from_page, to_scan = spawn.Pipe(duplex=False)
    page = spawn.Process(target=_show, args=(receiving, to_scan, folder), daemon=True)
    page.start()
    receiving.close()
    to_scan.close()
    try:
        if not from_page.poll(SERVED_S):
            raise EOFError
        address = from_page.recv()
    except EOFError:
        page.terminate()
        raise ScanwrightError("live: the page could not be served; scan without it") from None
    print(f"open {address}", flush=True)
    if browse is None and sys.stdout.isatty():
        browse = webbrowser.open
    if browse is not None and browse(address):
        from_page.poll(OPENED_S)
    feed = Feed(sending)
    try:
        yield feed
    finally:
        if feed.end is not None:
            with suppress(KeyboardInterrupt):
                page.join(_CLOSED_S)
                if page.is_alive():
                    print("the page shows how the scan ended: close it, or press Ctrl-C", file=sys.stderr, flush=True)
                page.join()


def _show(receiving: Connection, to_scan: Connection, folder: Path) -> None:
    """Show the growing cloud in the page's process, and wait until its last visitor leaves."""
    from scanwright.live.cloud_view import CloudView
    from scanwright.serving.page_server import guarded_server, wait_until_alone

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the scan, and that ends this
    in_use = angles_in_use(folder)
    placing = Placing(in_use.angles, own_body_of(in_use.path))
    with guarded_server(f"Scanwright: scan of {folder.name}") as (server, gate):
        motion = in_use.angles.motion
        full_scan_s = None if motion is None else motion.duration_s
        view = CloudView(server, folder.name, in_use.angles.T_world_rot(0.0)[:3, 3], full_scan_s)
        to_scan.send(gate.address)

        def report_visitor() -> None:
            while not gate.visitors:
                time.sleep(0.05)
            to_scan.send("seen")

        Thread(target=report_visitor, name="visitor", daemon=True).start()
        if (folder / "task.toml").is_file():
            Thread(target=_expect, args=(view, folder, in_use.angles), name="expected", daemon=True).start()
        for growth in growing(receiving, placing):
            view.add(growth)
        if view.end is None:  # the scan program went away
            view.show_end(LOST)
        view.show_message("this page ends when you close it")
        if gate.visitors:
            wait_until_alone(gate, ALONE_S)


def _expect(view: CloudView, folder: Path, angles: AngleSet) -> None:
    """Show the beam density of a full scan on the walls, in the region of interest."""
    from scanwright.report.answer import mounting_rad, problem_as_built
    from scanwright.report.density_sphere import DENSEST
    from scanwright.report.room import room_about
    from scanwright.serving.density_room import DensityRoom

    own_body = folder / "own_body.npz"
    try:
        loaded = load_task(folder / "task.toml")
        problem = problem_as_built(loaded, angles)
        walls = DensityRoom(view.server.scene, room_about(loaded.task), view.centre_m)
        weighted = problem.field.weight_at(walls.directions) > 0
        shadow = load_self_occlusion(own_body)[0] if own_body.is_file() else None
        density = mean_density_at(problem, mounting_rad(angles), walls.directions, shadow)
    except ScanwrightError as error:
        _LOG.warning("live: no expected density: %s", error)
        return
    bands = bands_to(float(np.quantile(density[weighted], DENSEST)))
    walls.colour(density, bands, EXPECTED_OPACITY * weighted)
    view.expect(walls, bands)
