"""What the live pages may take: the first picture, and frames while a large cloud is turned.

    uv run python -m benchmarks.scanwright.budgets                        # studio and live page
    uv run python -m benchmarks.scanwright.budgets frames --points 5      # millions

First picture: from the address to the first frame with the room, in a browser that has never seen the page.
Frames: those that are drawn in five seconds in which the view is turned, with that many points; and what the server's
process spends on the points that are handed to it at once. Needs Chromium; the first line says what draws (without a
graphics card the processor) and how busy the computer is with other things.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.scanwright.screens import CHROMIUM
from scanwright.design.task.task import load_task
from scanwright.firmware_io.scan.live_feed import CloudGrowth
from scanwright.live.cloud_view import CloudView
from scanwright.serving.page_server import guarded_server
from scanwright.studio.page import Studio

SIZE = {"width": 1440, "height": 900}
BATCH = 2_000  # points that the feed of a UTM-30LX hands over at once
TURNED_S = 5.0
DRAWN = """() => {
  const look = () => {
    const drawn = window.__viserTestpoints?.rendererInfo.render;
    if (drawn && drawn.triangles + drawn.points > 1000) window.drawn_ms = performance.now();
    else requestAnimationFrame(look);
  };
  look();
}"""
TURN = """async (seconds) => {
  const { cameraControl, requestRender } = window.__viserMutable;
  const drawn = window.__viserTestpoints.rendererInfo.render;
  const [began, before] = [performance.now(), drawn.frame];
  while (performance.now() - began < 1000 * seconds) {
    cameraControl.rotate(0.02, 0, false);
    requestRender();
    await new Promise(requestAnimationFrame);
  }
  return (1000 * (drawn.frame - before)) / (performance.now() - began);
}"""
THERE = """Object.entries(window.__viserMutable?.nodeRefFromName ?? {}).reduce((points, [name, node]) => {
  if (node && name.startsWith("/cloud/")) node.traverse((child) => {
    if (child.isPoints) points += child.geometry.attributes.position?.count ?? 0;
  });
  return points;
}, 0)"""
CARD = """() => {
  const gl = document.createElement('canvas').getContext('webgl2');
  return gl.getParameter(gl.getExtension('WEBGL_debug_renderer_info').UNMASKED_RENDERER_WEBGL);
}"""


def main() -> None:
    """Parse the command line, and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", metavar="WHAT", help="picture, frames; both if none is named")
    parser.add_argument("--points", type=float, default=5.0, help="millions")
    parser.add_argument("--count", type=int, default=5, help="of first pictures")
    given = parser.parse_args()
    with browser() as chromium:
        page = chromium.new_page()
        load = f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}"
        print(f"drawn by {page.evaluate(CARD)}; {load}")
        if not given.what or "picture" in given.what:
            picture(chromium, given.count)
        if not given.what or "frames" in given.what:
            frames(chromium, round(given.points * 1e6))


@contextmanager
def browser() -> Iterator[Any]:
    """Chromium as the tests start it."""
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium")
    if program is None:
        raise SystemExit("chromium is not installed")
    with sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=program, args=CHROMIUM)
        yield started
        started.close()


def picture(chromium: Any, count: int) -> None:
    """The studio's first picture, with nothing else at work."""
    took: list[float] = []
    with guarded_server("a page") as (server, gate):
        studio = Studio(server, load_task("ground_ahead"), Path.cwd(), Path.cwd() / "out")
        studio.judging.settled(60)
        studio.workers.settled(60)
        for _ in range(count):
            context = chromium.new_context(viewport=SIZE)
            context.add_init_script(f"({DRAWN})()")
            page = context.new_page()
            page.goto(gate.address)
            page.wait_for_function("window.drawn_ms", timeout=60_000)
            took.append(page.evaluate("window.drawn_ms") / 1000)
            context.close()
        studio.close()
    median = statistics.median(took)
    print(f"studio, first picture at 1440 x 900: median {median:.2f} s, worst {max(took):.2f} s of {count}")


def frames(chromium: Any, points: int) -> None:
    """The live page with so many points."""
    rng = np.random.default_rng(0)
    with guarded_server("a page") as (server, gate):
        view = CloudView(server, "scan", np.zeros(3))
        nothing = np.zeros(BATCH, np.float32)
        spent: list[float] = []
        for k in range(points // len(nothing)):
            room = rng.uniform(-1, 1, (len(nothing), 3)).astype(np.float32) * np.array([4, 4, 1.5], np.float32)
            began = time.process_time()
            view.add(CloudGrowth(room, nothing, nothing + k, (), 0))
            spent.append(time.process_time() - began)
        page = chromium.new_context(viewport=SIZE).new_page()
        page.set_default_timeout(300_000)
        page.goto(gate.address)
        page.wait_for_function(f"{THERE} >= {view.points - view.forgotten}")
        page.wait_for_timeout(2000)
        rate = page.evaluate(TURN, TURNED_S)
        per_scan_ms = 1e3 * statistics.median(spent)
    print(
        f"live page, {points:,} points at 1440 x 900: {rate:.1f} frames a second while it is turned; the server spends "
        f"{per_scan_ms:.2f} ms of a core on each {len(nothing):,} points"
    )


if __name__ == "__main__":
    main()
