"""Plan of a scan, checked before any device is opened."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from pydantic import ValidationError

from scanwright.design.angles import CALIBRATED, AngleSet, angles_in_use
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import RecordingError, ScanwrightError
from scanwright.design.files.atomic_file import check_place, place_in
from scanwright.design.motion import Motion, Spin, Sweep
from scanwright.firmware_io.device_ports import Ports, find_ports
from scanwright.firmware_io.lidar.lidar import Echo, StampAt

_LONGEST_S = 7 * 24 * 3600.0  # a week


@dataclass(frozen=True, slots=True)
class ScanPlan:
    """Plan of one scan; for the other fields see `plan_scan`."""

    angles: AngleSet  # calibrated, if there is a calibration
    angles_path: Path
    frames: str  # description of the angle set
    motion: Motion
    turns: int
    intensity: bool
    cluster: int
    every: int
    stamp_at: StampAt | None
    echo: Echo | None
    mean_filter_off: bool
    ports: Ports
    servo_id: int | None
    recording: Path
    attached: dict[str, str]  # files kept inside the recording, name -> text
    endless: bool = False

    @property
    def duration_s(self) -> float:
        """Duration of the recording."""
        return self.turns * self.motion.duration_s

    def lines(self) -> list[str]:
        """Describe the plan."""
        emulated = f" (emulated by process {self.ports.pid})" if self.ports.pid else ""
        each = f"{self.motion.mode} of {self.motion.duration_s:g} s"
        recorded = [f"{self.turns} x {each}: {self.duration_s:g} s of recording", f"output {self.recording}"]
        return [
            f"lidar {self.angles.sensor} at {self.ports.lidar}{emulated}",
            f"servo {self.angles.servo} at {self.ports.servo}{emulated}",
            self.frames,
            *([f"{each}, again and again until Ctrl-C"] if self.endless else recorded),
        ]


def plan_scan(
    out: Path,
    *,
    turns: int = 1,
    period_s: float | None = None,
    lidar: str | None = None,
    servo: str | None = None,
    servo_id: int | None = None,
    recording: Path | None = None,
    intensity: bool = False,
    cluster: int = 1,
    every: int = 1,
    stamp_at: StampAt | None = None,
    echo: Echo | None = None,
    mean_filter_off: bool = False,
    endless: bool = False,
) -> ScanPlan:
    """Plan a scan with the scanner of a build folder, without opening a device or writing a file.

    The arguments are those of `scanwright.scan`. An `endless` scan records nothing and runs until it is stopped;
    `turns` and `recording` have no effect.

    Raises:
        ScanwrightError: no angle set, no motion, a servo that cannot measure it, no port, or an invalid file name.
    """
    in_use = angles_in_use(out)
    angles = in_use.angles
    if turns < 1:
        raise ScanwrightError(f"turns = {turns}: at least 1")
    if angles.motion is None:
        raise ScanwrightError(f"{out / 'angles.json'}: motion = null: this angle set has no motion of the servo")
    motion = angles.motion if period_s is None else _with_period(angles.motion, period_s)
    if turns * motion.duration_s > _LONGEST_S:
        most = int(_LONGEST_S / motion.duration_s)
        raise ScanwrightError(f"turns = {turns}: of {motion.duration_s:g} s each: at most {most}, a week")
    product = load_catalogue().products.get(angles.servo)
    if isinstance(angles.motion, Spin) and isinstance(product, Servo) and product.position_feedback_deg < 360:
        raise ScanwrightError(
            f"{out / 'angles.json'}: motion.mode = 'spin': {angles.servo} measures its angle in "
            f"{product.position_feedback_deg:g} of 360 deg only: make it a 'sweep', or choose a servo such as MX-64R"
        )
    if recording is not None:
        _check_name(recording)
    files = [path for name in ("angles.json", CALIBRATED, "task.toml") if (path := out / name).is_file()]
    return ScanPlan(
        angles=angles,
        angles_path=in_use.path,
        frames=in_use.description,
        motion=motion,
        turns=turns,
        intensity=intensity,
        cluster=cluster,
        every=every,
        stamp_at=stamp_at,
        echo=echo,
        mean_filter_off=mean_filter_off,
        ports=find_ports(out, lidar, servo),
        servo_id=servo_id,
        recording=recording or place_in(out, f"recordings/{datetime.now():%Y%m%d-%H%M%S}.mcap", RecordingError),
        attached={path.name: path.read_text(encoding="utf-8") for path in files},
        endless=endless,
    )


def _with_period(motion: Motion, period_s: float) -> Motion:
    if not isinstance(motion, Spin | Sweep):
        raise ScanwrightError(f"period_s = {period_s:g}: a {motion.mode} motion has none; omit it")
    try:
        return type(motion).model_validate(motion.model_dump() | {"period_s": period_s})
    except ValidationError as error:
        why = error.errors()[0]["msg"].removeprefix("Value error, ").removeprefix(f"period_s = {period_s:g}: ")
        raise ScanwrightError(f"period_s = {period_s:g}: {why}") from None


def _check_name(recording: Path) -> None:
    check_place(recording, RecordingError)
    if recording.suffix != ".mcap":
        raise RecordingError(f"{recording}: recordings are MCAP files; name it {recording.with_suffix('.mcap').name}")
    if recording.exists():
        raise RecordingError(f"{recording}: exists; a recording is never overwritten")
