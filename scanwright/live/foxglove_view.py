"""`scanwright view` and `scan --foxglove`: serve a recording or a scan to Foxglove, or write it for Foxglove."""

from __future__ import annotations

import logging
import signal
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

from mcap.writer import Writer

from scanwright.design.angles import angles_in_use, load_angles
from scanwright.design.errors import RecordingError, TaskError
from scanwright.design.files.atomic_file import atomic_write, check_place
from scanwright.design.progress import Progress
from scanwright.firmware_io.assembly.own_body import own_body_of
from scanwright.firmware_io.recording.mcap_chunks import read_note, rests_in_scans
from scanwright.firmware_io.recording.recording import open_recording
from scanwright.firmware_io.ros.replay import replay
from scanwright.firmware_io.ros.robot_frames import description
from scanwright.firmware_io.samples import JointSample, Scan
from scanwright.firmware_io.scan.live_feed import Batch, Feed, Viewer, Watch, batches
from scanwright.live.foxglove_channels import FoxgloveChannels, Log, channels
from scanwright.live.foxglove_server import foxglove_server

_LOG = logging.getLogger(__name__)
PORT = 8765  # the default of Foxglove
_SETTLED_S = 0.5  # a viewer subscribes topic by topic


def view_recording(
    recording: Path,
    angles: Path,
    progress: Progress,
    *,
    port: int = PORT,
    rate: float = 1.0,
    allow_origins: Collection[str] = (),
    announce: Callable[[str], None] = lambda _: None,
) -> None:
    """Serve a recording at its own pace to each viewer, until Ctrl-C.

    Raises:
        RecordingError: the recording is unreadable.
        TaskError: the port is taken.
    """
    open_recording(recording)  # an error comes before the address
    with foxglove_server(recording.name, channels(), port, progress, allow_origins) as server:
        announce(server.address)
        shown = _shown(recording, angles, server.log)
        while True:
            _until(lambda: server.has_subscribers)
            time.sleep(_SETTLED_S)
            shown.begin()
            scans, _ = replay(recording, shown, rate=rate)
            shown.close()
            progress(f"showed {scans:,} scans; Ctrl-C to end")
            _until(lambda: not server.has_subscribers)
            progress("no viewer is connected; the next one gets the recording from its start")


def _until(condition: Callable[[], bool]) -> None:
    while not condition():
        time.sleep(0.1)


def write_for_foxglove(recording: Path, angles: Path, out: Path) -> int:
    """Write a recording with points, frames and description; return the number of scans.

    Raises:
        RecordingError: the recording is unreadable, or the file cannot be written.
    """
    check_place(out, RecordingError)
    if out.suffix != ".mcap":
        raise RecordingError(f"{out}: Foxglove reads MCAP; name it {out.with_suffix('.mcap').name}")
    with atomic_write(out, RecordingError) as part, mcap_log(part) as log:
        shown = _shown(recording, angles, log)
        scans, _ = replay(recording, shown, wait_until=lambda _: None)
        shown.close()
    return scans


@contextmanager
def mcap_log(path: Path) -> Iterator[Log]:
    """Write the channels to an MCAP file, which is complete when the body ends."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="scanwright")
        number = {
            topic: writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", definition.encode()))
            for topic, (kind, definition) in channels().items()
        }
        yield lambda topic, data, time_ns: writer.add_message(number[topic], time_ns, data, time_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def _shown(recording: Path, angles: Path, log: Log) -> FoxgloveChannels:
    angle_set = load_angles(angles)
    smooth = not rests_in_scans(read_note(recording))
    urdf = description(angles.parent, angle_set)
    return FoxgloveChannels(angle_set, own_body_of(angles), urdf, log, smooth=smooth)


@contextmanager
def foxglove_feed(folder: Path, allow_origins: Collection[str] = ()) -> Iterator[Viewer]:
    """Serve a scan from a process of its own, so that the scan never waits for a viewer."""
    spawn = get_context("spawn")
    receiving, sending = spawn.Pipe(duplex=False)
    serving = spawn.Process(target=_serve, args=(receiving, folder, tuple(allow_origins)), daemon=True)
    serving.start()
    receiving.close()
    yield Feed(sending)
    with suppress(KeyboardInterrupt):
        serving.join()


def _serve(receiving: Connection, folder: Path, allow_origins: tuple[str, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the scan, and that ends this
    in_use = angles_in_use(folder)
    urdf, wall_minus_ns = description(folder, in_use.angles), time.time_ns() - time.monotonic_ns()
    own_body = own_body_of(in_use.path)

    try:
        with foxglove_server(f"scan of {folder.name}", channels(), PORT, _print, allow_origins) as server:
            shown = FoxgloveChannels(in_use.angles, own_body, urdf, server.log, wall_minus_ns=wall_minus_ns)
            for batch in batches(receiving):
                pass_on(batch, shown)
            shown.close()
    except TaskError as error:  # the port is taken: the scan goes on
        _LOG.warning("no viewer can connect: %s", error)


def _print(step: str, _fraction: float | None = None, /) -> None:
    print(step, flush=True)


def pass_on(batch: Batch, watch: Watch) -> None:
    """Pass on the data of a batch in the order in which they were measured."""
    angles = [JointSample(*pair) for pair in zip(batch.time_ns.tolist(), batch.position_rad.tolist(), strict=True)]
    ended = [(one.time_ns, one) for one in angles] + [(int(scan.time_ns[-1]), scan) for scan in batch.scans]
    for _, thing in sorted(ended, key=lambda pair: pair[0]):
        if isinstance(thing, Scan):
            watch.scan(thing)
        else:
            watch.joint(thing.time_ns, thing.position_rad)
    for line in batch.lines:
        watch.message(line)
