"""How fast the studio answers, and whether the live view keeps up.

    uv run python -m benchmarks.scanwright.studio                                      # all three
    uv run python -m benchmarks.scanwright.studio moves --task ground_ahead --count 300
    uv run python -m benchmarks.scanwright.studio rebuild --count 40
    uv run python -m benchmarks.scanwright.studio live

Moves: a client of the page's own websocket moves a slider, waits for the facts and the colours of the room that
answer it, and moves on a thirtieth of a second later, as a hand does. Times are from the message that leaves to the
last one that arrives, unpacked: what a browser adds is its drawing. The goal is 60 ms at the 95th percentile. Then J at
20 random settings is compared with `evaluate`.

Rebuild: the client drags two sliders for a third of a second and lets go; times are from the last message of the hand
to the arrival of the half of the scanner that turns (linkage, shaft, lidar), and of the half that stands.

Live: scans of 1,081 beams at 40 Hz, and as fast as they can be handed over, go through the feed, the pipe and the frame
chain into a page with a visitor; what counts is how long the scan's thread is held up, how far behind the view is at
the end, and what it left out.
"""

from __future__ import annotations

import argparse
import multiprocessing
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import msgspec
import numpy as np
import viser
import zstandard
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

import scanwright as sw
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.task.task import load_task
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.scan.live_feed import EVERY_S, Feed, Placing, growing
from scanwright.live.cloud_view import CloudView
from scanwright.serving.gate import Gate
from scanwright.serving.page_server import guarded_server
from scanwright.studio.page import Studio
from scanwright.studio.panel.controls import put
from scanwright.studio.state import Setting
from scanwright.studio.view.latest_only import REST_S
from scanwright.studio.view.scanner_bodies import make_bodies
from scanwright.studio.view.workers import Order

WHAT = ("moves", "rebuild", "live")
HAND_HZ = 30.0
BEAMS, SCAN_HZ = 1081, 40.0
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 1.0, 1.0),
    "fov": 1.0,
    "near": 0.01,
    "far": 100.0,
    "image_height": 900,
    "image_width": 1400,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}


def main() -> None:
    """Parse the command line, and measure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="*", metavar="WHAT", help="moves, rebuild, live; all if none is named")
    parser.add_argument("--task", type=Path, default=Path("ground_ahead"))
    parser.add_argument("--count", type=int, help="of moves (300) or rebuilds (40)")
    given = parser.parse_args()
    if unknown := set(given.what) - set(WHAT):
        parser.error(f"{unknown.pop()}: none of {', '.join(WHAT)}")
    for what in given.what or WHAT:
        if what == "moves":
            moves(given.task, given.count or 300)
        elif what == "rebuild":
            rebuild(given.task, given.count or 40)
        else:
            live(10.0, SCAN_HZ)
            live(10.0, 8 * SCAN_HZ)


def moves(task: Path, count: int) -> None:
    """From slider to picture, for a hand that moves and never rests."""
    loaded = load_task(task)
    with guarded_server("a page") as (server, gate):
        studio = Studio(server, loaded, Path.cwd(), Path.cwd() / "out")
        put(studio.controls.scanner, False)
        compute = []
        with visitor(gate) as socket:
            studio.move(Setting((10, -50, -70, 60)))  # where every angle matters: what stays the same is not sent
            studio.judging.settled(60)
            told: SimpleQueue[tuple[float, str]] = SimpleQueue()
            facts = studio.controls.facts._impl.uuid
            threading.Thread(target=_listen, args=(socket, facts, told), daemon=True).start()
            rng, answered = np.random.default_rng(0), []
            angles = np.array(studio.setting.angles_deg)
            time.sleep(1.0)
            for k in range(count):
                slider, bound = studio.controls.angles[k % 4], 180.0 if k % 4 == 0 else 90.0
                step = rng.choice([-1, 1]) * rng.uniform(1, 8)
                angles[k % 4] += step if abs(angles[k % 4] + step) <= bound else -step
                while not told.empty():
                    told.get()
                sent = time.perf_counter()
                _slide(socket, slider, float(angles[k % 4]))
                missing, when = {"facts", "colours"}, sent
                while missing:
                    when, what = told.get(timeout=10)
                    missing.discard(what)
                answered.append(when - sent)
                time.sleep(1 / HAND_HZ)
            for _ in range(20):
                began = time.perf_counter()
                studio.judge.quick(studio.setting)
                compute.append(time.perf_counter() - began)
            equal = [_shows_what_evaluate_prints(studio, task, rng) for _ in range(20)]
        studio.close()
    ms = 1e3 * np.array(answered)
    print(
        f"{task}: {len(ms)} moves, from slider to facts and colours: median {np.median(ms):.0f} ms, "
        f"95th percentile {np.percentile(ms, 95):.0f} ms, worst {ms.max():.0f} ms; "
        f"of these J, gaps and period {1e3 * np.median(compute):.0f} ms; "
        f"J is that of evaluate at {sum(equal)} of {len(equal)} random settings"
    )


def _shows_what_evaluate_prints(studio: Studio, task: Path, rng: np.random.Generator) -> bool:
    setting = Setting.within_bounds(rng.uniform(-1, 1, 4) * (180.0, 90.0, 90.0, 90.0))
    studio.move(setting)
    studio.judging.settled(60)
    facts = studio.facts
    assert facts is not None and facts.exact and facts.setting == setting
    return facts.J == sw.evaluate(task, setting.angles_deg).score.J


def rebuild(task: Path, count: int) -> None:
    """From the hand that lets go to the new scanner, at settings all over the sliders."""
    loaded = load_task(task)
    took: dict[str, list[float]] = {"turning": [], "standing": []}
    work: dict[str, list[float]] = {"turning": [], "standing": []}
    refused = 0
    with guarded_server("a page") as (server, gate):
        studio = Studio(server, loaded, Path.cwd(), Path.cwd() / "out")
        with visitor(gate) as socket:
            told: SimpleQueue[tuple[float, str]] = SimpleQueue()
            threading.Thread(target=_listen, args=(socket, "", told), daemon=True).start()
            studio.judging.settled(120)
            studio.workers.settled(120)
            rng, angles = np.random.default_rng(0), np.array(studio.setting.angles_deg)
            for _ in range(count):
                while not told.empty():
                    told.get()
                moved, goal = rng.choice(4, 2, replace=False), rng.uniform(-1, 1, 4) * (180.0, 90.0, 90.0, 90.0)
                for step in np.linspace(0, 1, 10):
                    for k in moved:
                        value = float(angles[k] + step * (goal[k] - angles[k]))
                        _slide(socket, studio.controls.angles[k], value)
                        released = time.perf_counter()
                    time.sleep(1 / HAND_HZ)
                angles[moved] = goal[moved]
                until = released + 30
                while not studio.judging.settled(0) and time.perf_counter() < until:
                    time.sleep(0.01)
                studio.workers.settled(30)
                time.sleep(0.1)  # for what is on its way
                arrived = {}
                while not told.empty():
                    when, what = told.get()
                    arrived[what] = when - released
                if studio.controls.making.content:
                    refused += 1
                    continue
                for half, times in took.items():
                    if half in arrived:  # parts that stay the same are not made again
                        times.append(arrived[half])
                        began = time.process_time()
                        order = Order(loaded, studio.judge.problem, studio.setting, True, "")
                        make_bodies(order.scanner(), half == "turning")
                        work[half].append(time.process_time() - began)
        studio.close()
    for half, times in took.items():
        print(
            f"{task}: {len(times)} rebuilds, from letting go to the {half} half: median {np.median(times):.2f} s, "
            f"95th percentile {np.percentile(times, 95):.2f} s, worst {max(times):.2f} s; of these {REST_S:g} s are "
            f"rest, and {np.median(work[half][1:]):.2f} s (at most {max(work[half][1:]):.2f}) of a core are the parts"
        )
    print(f"{refused} settings refused: they cannot be built")


def _slide(socket: ClientConnection, slider: Any, value: float) -> None:
    """Move a slider as the page does."""
    message = {"type": "GuiUpdateMessage", "uuid": slider._impl.uuid, "updates": {"value": value}}
    socket.send(msgspec.msgpack.encode(message))


def _listen(socket: ClientConnection, facts: str, told: SimpleQueue[tuple[float, str]]) -> None:
    """Note when facts, colours and bodies arrive."""
    for data in _until_closed(socket):
        assert isinstance(data, bytes)
        now = time.perf_counter()
        size = int.from_bytes(data[8:16], "little")
        inner = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data[16 : 16 + size]))
        for message in inner["messages"]:
            if message.get("uuid") == facts and "content" in message.get("updates", {}):
                told.put((now, "facts"))
            if message.get("name") == "/room/5" and "_data" in message.get("updates", {}):
                told.put((now, "colours"))
            if message["type"] == "MeshMessage":
                told.put((now, message["name"].split("/")[2]))


def _until_closed(socket: ClientConnection) -> Iterator[str | bytes]:
    with suppress(ConnectionClosed):
        yield from socket


def live(seconds: float, rate_hz: float) -> None:
    """The growing cloud under a stream of scans."""
    angles = AngleSet(
        task="bench",
        angles_deg=Angles(alpha_rot=0, beta_rot=-55, alpha_laser=-80, beta_laser=75),
        sensor="UTM-30LX",
        servo="MX-64R",
        motion={"mode": "spin", "period_s": 2.0},
    )
    receiving, sending = multiprocessing.Pipe(duplex=False)
    finished: list[float] = []
    with guarded_server("a page") as (server, gate):
        view = CloudView(server, "scan", np.zeros(3))

        def watch() -> None:
            for more in growing(receiving, Placing(angles, None)):
                view.add(more)
                finished.append(time.perf_counter())

        with visitor(gate) as socket:
            threading.Thread(target=lambda: list(map(len, _until_closed(socket))), daemon=True).start()
            viewer = threading.Thread(target=watch)
            viewer.start()
            feed = Feed(sending)
            held, scans = [], list(_scans(int(seconds * rate_hz), rate_hz))
            began = time.perf_counter()
            for k, scan in enumerate(scans):
                time.sleep(max(0.0, began + k / rate_hz - time.perf_counter()))
                start = time.perf_counter()
                for j in range(3):
                    stamp = scan.stamp_ns + round((j - 0.5) * 1e9 / rate_hz)
                    feed.joint(stamp, np.pi * stamp / 1e9)
                feed.scan(scan)
                held.append(time.perf_counter() - start)
            ended = time.perf_counter()
            feed.close()
            viewer.join()
        behind = finished[-1] - ended
    held_us = 1e6 * np.array(held)
    print(
        f"live, {rate_hz:g} scans/s of {BEAMS:,} beams for {seconds:g} s: {view.points:,} points shown, "
        f"{feed.lost} scans left out; the scan's thread is held up {np.median(held_us):.0f} us a scan "
        f"(99th percentile {np.percentile(held_us, 99):.0f}); the last points stand {behind:.2f} s after the last scan "
        f"(they are sent every {EVERY_S:g} s)"
    )


def _scans(count: int, rate_hz: float) -> Iterator[Scan]:
    rng = np.random.default_rng(0)
    for k in range(count):
        yield Scan(
            stamp_ns=1_000_000_000 + round(1e9 * k / rate_hz),
            angle_min_rad=-2.356,
            angle_increment_rad=4.712 / (BEAMS - 1),
            time_increment_s=0.7 / rate_hz / BEAMS,
            scan_time_s=1 / rate_hz,
            range_min_m=0.1,
            range_max_m=30.0,
            range_m=rng.uniform(0.5, 8.0, BEAMS).astype(np.float32),
            intensity=np.empty(0, np.float32),
        )


@contextmanager
def visitor(gate: Gate) -> Iterator[Any]:
    """A client as the page is one."""
    with connect(
        f"ws://127.0.0.1:{gate.port}/",
        origin=Origin(f"http://127.0.0.1:{gate.port}"),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        additional_headers={"Cookie": f"scanwright-{gate.port}={gate.token}"},
        compression=None,
        max_size=None,
    ) as socket:
        socket.send(msgspec.msgpack.encode(CAMERA))
        yield socket


if __name__ == "__main__":
    main()
