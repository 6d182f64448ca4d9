"""Scans until it is ended, for a node: devices that fail are tried again, parameters stop and start them."""

from __future__ import annotations

import logging
import time
from dataclasses import replace
from typing import Protocol

from scanwright.design.errors import DeviceError
from scanwright.design.motion import Motion, Spin
from scanwright.design.progress import Progress
from scanwright.firmware_io.scan.acquire import acquire
from scanwright.firmware_io.scan.live_feed import UNWATCHED, Both, Watch
from scanwright.firmware_io.scan.plan import ScanPlan
from scanwright.firmware_io.servo.fitness import ServoSetupError

_log = logging.getLogger(__name__)

AGAIN_S = 3.0  # a device that was unplugged is there again after some seconds
_MOST_TRIES, _WELL_S = 100, 60.0  # in a row: some minutes; a run of a minute begins a new row
_POLL_S = 1.0  # for a parameter that starts the scanner


class Interrupted(Exception):  # noqa: N818 - it is no error
    """Raised by a steered watch: the devices are stopped, and what it wants next is asked."""


class Steered(Watch, Protocol):
    """A watch that also says what shall happen. Any of its `Watch` methods may raise `Interrupted`."""

    @property
    def running(self) -> bool:
        """Whether the scanner shall turn."""

    @property
    def period_s(self) -> float:
        """Time of one turn; 0 for the motion of the angle set."""

    def begin(self) -> None:
        """The devices start anew."""

    def failed(self, line: str) -> None:
        """A device failed; it is tried again."""

    def wait(self, seconds: float) -> None:
        """Until something else is wanted, at most so long."""


def drive(plan: ScanPlan, steered: Steered, progress: Progress, viewer: Watch = UNWATCHED) -> None:
    """Scan until something else than a device ends it, such as Ctrl-C; the devices are stopped on every way out.

    Args:
        plan: endless.
        steered: is told of the scan, and says what shall happen.
        progress: gets each step.
        viewer: gets the scan too.

    Raises:
        ServoSetupError: settings of the servo that outlast the power must change first.
        DeviceError: devices have failed a hundred times in a row.
    """
    watch, tries = Both(steered, viewer), 0
    while True:
        if not steered.running:
            steered.wait(_POLL_S)
            continue
        steered.begin()
        began_s = time.monotonic()
        try:
            acquire(replace(plan, motion=_motion(plan.motion, steered.period_s)), progress, watch)
        except Interrupted:
            progress("stopped by a parameter")
        except ServoSetupError:  # trying again would not help: somebody must agree
            raise
        except DeviceError as error:
            tries = 1 if time.monotonic() - began_s > _WELL_S else tries + 1
            if tries == _MOST_TRIES:
                raise
            line = f"{error}; trying again in {AGAIN_S:g} s"
            steered.failed(line)
            _log.error("%s", line)
            steered.wait(AGAIN_S)


def _motion(motion: Motion, period_s: float) -> Motion:
    return Spin(mode="spin", period_s=period_s) if period_s and isinstance(motion, Spin) else motion
