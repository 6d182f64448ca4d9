"""Recorder of a live scan; a crash loses less than a second.

Every quarter of a second the messages so far are written as one chunk and synced. After kill -9, a full disk or a power
cut the file has no index; `scanwright repair` adds it. Device times are on the monotonic clock; the difference to the
wall clock is taken once at the start and kept in the file.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path

from mcap.writer import Writer

from scanwright.design.errors import DeviceError, RecordingError
from scanwright.firmware_io.recording.mcap_chunks import CHUNK_S
from scanwright.firmware_io.recording.recording import MessageWriter
from scanwright.firmware_io.samples import Scan
from scanwright.firmware_io.scan.live_feed import UNWATCHED, Watch


class Recorder:
    """Recorder; a context manager. A thread waits for the disk, so that `scan` and `joint` return at once.

    Args:
        path: of the file.
        note: origin of the recording.
        attached: files to keep inside it (name -> text), such as angles.json.

    Raises:
        RecordingError: the file exists or cannot be created.
        DeviceError: a write fails; earlier data can be repaired.
    """

    def __init__(self, path: Path, note: Mapping[str, str], attached: Mapping[str, str]) -> None:
        self._path = path
        self._wall_minus_monotonic_ns = time.time_ns() - time.monotonic_ns()
        self._note = {**note, "wall_minus_monotonic_ns": str(self._wall_minus_monotonic_ns)}
        self._attached = attached
        self._lock = threading.Lock()
        self._done = threading.Event()
        self._failure: Exception | None = None

    def __enter__(self) -> Recorder:
        try:
            self._file = _AtomicWrites(self._path)
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot write: {error.strerror or error}") from error
        self._messages = MessageWriter(self._file, self._path, self._note, self._attached, Writer)
        self._thread = threading.Thread(target=self._keep, name="recorder", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()
        try:
            self._check()
            self._messages.finish()
            self._file.flush()
            self._file.sync()
        except OSError as refused:
            raise self._lost(refused) from refused
        finally:
            self._file.close()

    def scan(self, scan: Scan) -> None:
        """Append one scan; its stamp is on the monotonic clock."""
        self._check()
        with self._lock:
            self._messages.scan(replace(scan, stamp_ns=scan.stamp_ns + self._wall_minus_monotonic_ns))

    def joint(self, time_ns: int, position_rad: float) -> None:
        """Append one sample of the spin joint; its time is on the monotonic clock."""
        self._check()
        with self._lock:
            self._messages.joint(time_ns + self._wall_minus_monotonic_ns, position_rad)

    def _keep(self) -> None:
        try:
            while not self._done.wait(CHUNK_S):
                with self._lock:
                    self._messages.flush()
                self._file.sync()
        except Exception as error:  # raised by the next write of another thread
            self._failure = error

    def _check(self) -> None:
        if isinstance(self._failure, OSError):
            raise self._lost(self._failure) from self._failure
        if self._failure is not None:
            raise self._failure

    def _lost(self, error: OSError) -> DeviceError:
        kept = f"earlier data are on the disk: free space, then `scanwright repair {self._path}`"
        return DeviceError(f"{self._path}: cannot write: {error.strerror or error}; {kept}")


def recorder_of(
    path: Path | None, note: Mapping[str, str], attached: Mapping[str, str]
) -> AbstractContextManager[Recorder | Watch]:
    """Return the recorder of a file, whose folder is made, or one that writes nothing."""
    if path is None:
        return nullcontext(UNWATCHED)
    path.parent.mkdir(exist_ok=True)
    return Recorder(path, note, attached)


class _AtomicWrites:
    """A new file to which a flush appends all pending bytes or none."""

    def __init__(self, path: Path) -> None:
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
        self._size = 0
        self._pending = bytearray()

    def write(self, data: bytes) -> int:
        self._pending += data
        return len(data)

    def tell(self) -> int:
        return self._size + len(self._pending)

    def flush(self) -> None:
        rest = memoryview(bytes(self._pending))
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError:
            os.ftruncate(self._descriptor, self._size)
            raise
        self._size += len(self._pending)
        self._pending.clear()

    def sync(self) -> None:
        os.fsync(self._descriptor)

    def close(self) -> None:
        os.close(self._descriptor)
