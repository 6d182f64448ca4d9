"""`scanwright view` and `scan --foxglove`: a recording or a scan, served to Foxglove or written for it.

The server listens on this computer only. It takes nothing from who connects: no parameters, no services, no messages,
so that a page of somebody else's in the same browser could look at the points, and do nothing.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

import foxglove

from design.angles import angles_in_use, load_angles
from design.atomic_file import check_place, whole_file
from design.errors import DeviceError, RecordingError
from firmware_io.assembly.own_body import own_body_beside
from firmware_io.recording.mcap_chunks import read_note
from firmware_io.recording.metadata import NOTE, held_by
from firmware_io.recording.recording import open_recording
from firmware_io.ros.replay import replay
from firmware_io.ros.robot_frames import description
from firmware_io.samples import JointSample, Scan
from firmware_io.scan.live_feed import Batch, Feed, Watch, batches
from scanwright.live.foxglove_channels import FoxgloveChannels

PORT = 8765  # where Foxglove looks first
_BACKLOG = 4096  # messages that a slow viewer may be behind; the oldest are dropped beyond
_SETTLED_S = 0.5  # who subscribes does so topic by topic, and is served from a moment later on
Say = Callable[[str], None]


@contextmanager
def _server(context: foxglove.Context, name: str, port: int, say: Say) -> Iterator[None]:
    """Serve the channels of a context, which must be there: who connects while they are made may subscribe to none."""
    try:
        server = foxglove.start_server(
            name=name,
            host="127.0.0.1",
            port=port,
            context=context,
            message_backlog_size=_BACKLOG,
        )
    except (RuntimeError, OSError) as error:
        raise DeviceError(f"--port {port}: cannot serve there: {error}") from error
    say(f"open ws://127.0.0.1:{server.port} in Foxglove, or {server.app_url()}")
    try:
        yield
    finally:
        server.stop()


def view_recording(recording: Path, angles: Path, say: Say, *, port: int = PORT, rate: float = 1.0) -> None:
    """Serve a recording at its own pace to each who begins to listen, until Ctrl-C.

    Args:
        recording: MCAP recording.
        angles: angle set of the scanner; `scanner.urdf` and `own_body.npz` are looked for beside it.
        say: is told the address, at once.
        port: on this computer; 0 for any that is free.
        rate: how many times as fast as it was recorded.

    Raises:
        RecordingError: the recording is unreadable.
        DeviceError: the port is taken.
    """
    open_recording(recording)  # what cannot be read is refused before an address is told
    context = foxglove.Context()
    channels = _channels(recording, angles, context)
    with _server(context, recording.name, port, say):
        while True:
            _until(lambda: channels.heard)
            time.sleep(_SETTLED_S)
            channels.begin()
            scans, _ = replay(recording, channels, rate=rate)
            channels.close()
            say(f"showed {scans:,} scans; Ctrl-C to end")
            _until(lambda: not channels.heard)
            say("nobody listens any more: all again for the next one who does")


def _until(condition: Callable[[], bool]) -> None:
    # asked and not told: a listener of the SDK is called back by its threads, which `stop` waits for
    while not condition():
        time.sleep(0.1)


def write_for_foxglove(recording: Path, angles: Path, out: Path) -> int:
    """Write a recording with points, frames and description, so that Foxglove shows all of it from the file alone.

    Returns:
        How many scans it holds.

    Raises:
        RecordingError: the recording is unreadable, or the file cannot be written.
    """
    check_place(out, RecordingError)
    if out.suffix != ".mcap":
        raise RecordingError(f"{out}: Foxglove reads MCAP; name it {out.with_suffix('.mcap').name}")
    with whole_file(out, RecordingError) as part:
        context = foxglove.Context()
        with foxglove.open_mcap(part, allow_overwrite=True, context=context):
            channels = _channels(recording, angles, context)
            scans, _ = replay(recording, channels, wait_until=lambda _: None)
            channels.close()
    return scans


def _channels(recording: Path, angles: Path, context: foxglove.Context) -> FoxgloveChannels:
    found = load_angles(angles)
    smooth = not held_by(read_note(recording, NOTE))
    urdf = description(angles.parent, found)
    return FoxgloveChannels(found, own_body_beside(angles), urdf, context, smooth=smooth)


@contextmanager
def foxglove_feed(folder: Path) -> Iterator[Watch]:
    """What `acquire` tells of a scan, to a server in a process of its own: the scan never waits for a viewer."""
    spawn = get_context("spawn")
    receiving, sending = spawn.Pipe(duplex=False)
    serving = spawn.Process(target=_serve, args=(receiving, folder), daemon=True)
    serving.start()
    receiving.close()
    yield Feed(sending)
    with suppress(KeyboardInterrupt):
        serving.join()


def _serve(receiving: Connection, folder: Path) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends the scan, and that ends this
    in_use = angles_in_use(folder)
    urdf, wall_minus_ns = description(folder, in_use.angles), time.time_ns() - time.monotonic_ns()
    context = foxglove.Context()
    own_body = own_body_beside(in_use.path)
    channels = FoxgloveChannels(in_use.angles, own_body, urdf, context, wall_minus_ns=wall_minus_ns)
    with _server(context, f"scan of {folder.name}", PORT, lambda line: print(line, flush=True)):
        for batch in batches(receiving):
            tell(batch, channels)
        channels.close()


def tell(batch: Batch, watch: Watch) -> None:
    """Tell a batch in the order in which its things were measured."""
    angles = [JointSample(*pair) for pair in zip(batch.time_ns.tolist(), batch.position_rad.tolist(), strict=True)]
    ended = [(one.time_ns, one) for one in angles] + [(int(scan.time_ns[-1]), scan) for scan in batch.scans]
    for _, thing in sorted(ended, key=lambda pair: pair[0]):
        if isinstance(thing, Scan):
            watch.scan(thing)
        else:
            watch.joint(thing.time_ns, thing.position_rad)
    for line in batch.lines:
        watch.told(line)
