"""Endless scans for a node: failed devices are restarted, parameters stop and start them."""

from __future__ import annotations

import logging
import time
from dataclasses import replace
from typing import Protocol

from scanwright.design.errors import DeviceError
from scanwright.design.motion import Spin
from scanwright.design.progress import Progress
from scanwright.firmware_io.scan.acquire import acquire
from scanwright.firmware_io.scan.live_feed import UNWATCHED, Both, Watch
from scanwright.firmware_io.scan.plan import ScanPlan
from scanwright.firmware_io.servo.fitness import ServoSetupError

_log = logging.getLogger(__name__)
AGAIN_S = 3.0  # before a failed device is restarted
_MOST_TRIES, _WELL_S = 100, 60.0  # consecutive failures; a run of a minute resets their count
_POLL_S = 1.0  # for a parameter that starts the scanner


class Interrupted(Exception):  # noqa: N818 - not an error
    """Raised by a `Steered` watch to stop the devices after a change of its parameters."""


class Steered(Watch, Protocol):
    """A watch with parameters. Its `Watch` methods can raise `Interrupted`."""

    @property
    def running(self) -> bool:
        """Whether the scanner must turn."""

    @property
    def period_s(self) -> float:
        """Duration of one turn; 0 for the motion of the angle set."""

    def begin(self) -> None:
        """Prepare for a start of the devices."""

    def failed(self, line: str) -> None:
        """Report that a device failed and is restarted."""

    def wait(self, seconds: float) -> None:
        """Wait for a change of the parameters, at most `seconds`."""


def drive(plan: ScanPlan, steered: Steered, progress: Progress, viewer: Watch = UNWATCHED) -> None:
    """Scan until Ctrl-C or an exception other than of a device; the devices are stopped on every exit.

    `plan` is endless; `steered` receives the scan and has the parameters; `viewer` receives the scan too.

    Raises:
        ServoSetupError: permanent settings of the servo must change first.
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
            period_s, motion = steered.period_s, plan.motion
            if period_s and isinstance(motion, Spin):
                motion = Spin(mode="spin", period_s=period_s)
            acquire(replace(plan, motion=motion), progress, watch)
        except Interrupted:
            progress("stopped by a parameter")
        except ServoSetupError:  # requires consent, so a restart does not help
            raise
        except DeviceError as error:
            tries = 1 if time.monotonic() - began_s > _WELL_S else tries + 1
            if tries == _MOST_TRIES:
                raise
            line = f"{error}; trying again in {AGAIN_S:g} s"
            steered.failed(line)
            _log.error("%s", line)
            steered.wait(AGAIN_S)
