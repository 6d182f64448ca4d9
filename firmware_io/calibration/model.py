"""Model of the scanner with its errors: origin and direction of each beam.

In the fixed frame of the axis (`rot` at joint 0), a beam of joint angle j, bearing b and range r ends at

    p   = o + (r + bias) d,     o = Rz(psi) t,     d = Rz(psi) exp(delta) R_designed [cos b, sin b, 0]
    psi = j(t + lag) + cos1 cos j + sin1 sin j + cos2 cos 2j + sin2 sin 2j - way backlash / 2

The sign of the rotation is `direction`. Rotation about the axis, translation along it, and the zero of the bearing are
not observable in a static scene, so they are not parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int64
from numpy import ndarray
from numpy.typing import NDArray

from scanwright.design import frames
from scanwright.design.angles import AngleSet
from scanwright.design.arrays import Floats, Rotation
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.servo import Servo, most_backlash_deg
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.axis_curve import axis_curve
from scanwright.firmware_io.assembly.beam_outcome import Verdict, beam_verdicts
from scanwright.firmware_io.assembly.own_body import OwnBody
from scanwright.firmware_io.recording.recording import Recording
from scanwright.firmware_io.samples import AxisCurve

_SPEED_OVER_NS = 20_000_000  # longer than the time between two reads of a servo, shorter than a change of speed
AT_REST_RAD_S = np.radians(0.2)  # slower than any sweep, faster than noise of one encoder step


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter of a calibration."""

    name: str  # key in reports; ends in its unit
    words: str  # for messages
    shown: float  # factor from SI to `unit`
    unit: str  # in messages
    limit: float  # standard deviation [SI] above which it is not observable


_DEG, _MM, _MS = float(np.degrees(1.0)), 1e3, 1e3
_TURN, _DIRECTION = np.radians(0.15), 5e-3
PARAMETERS = (
    Parameter("delta_x_rad", "tilt about x", _DEG, "deg", _TURN),
    Parameter("delta_y_rad", "tilt about y", _DEG, "deg", _TURN),
    Parameter("t_x_m", "offset along x", _MM, "mm", _DIRECTION),
    Parameter("t_y_m", "offset along y", _MM, "mm", _DIRECTION),
    Parameter("range_bias_m", "range bias", _MM, "mm", _DIRECTION),
    Parameter("cos_1_rad", "1st harmonic, cosine", _DEG, "deg", _TURN),
    Parameter("sin_1_rad", "1st harmonic, sine", _DEG, "deg", _TURN),
    Parameter("cos_2_rad", "2nd harmonic, cosine", _DEG, "deg", _TURN),
    Parameter("sin_2_rad", "2nd harmonic, sine", _DEG, "deg", _TURN),
    Parameter("lag_s", "time offset", _MS, "ms", 2e-3),
    Parameter("backlash_rad", "backlash", _DEG, "deg", _TURN),
)
COUNT = len(PARAMETERS)
MOUNT = (0, 1, 2, 3)
BIAS, HARMONIC_1, HARMONIC_2, LAG, BACKLASH = (4,), (5, 6), (7, 8), (9,), (10,)


@dataclass(frozen=True, slots=True, eq=False)
class ReturnedBeams:
    """All beams with a return of all recordings, in the order of time; shapes (n,)."""

    range_m: Float64[ndarray, " n"]
    bearing_rad: Float64[ndarray, " n"]
    joint_rad: Float64[ndarray, " n"]  # logged joint angle at the beam's time plus lag
    speed_rad_s: Float64[ndarray, " n"]  # of the joint
    recording: Int64[ndarray, " n"]  # number of the beam's recording
    place: Int64[ndarray, " n"]  # number of the scanner's place
    time_ns: Int64[ndarray, " n"]
    curves: tuple[AxisCurve, ...]  # joint angle of each recording, smoothed as in `assemble`

    def select(self, which: NDArray[np.generic]) -> ReturnedBeams:
        """Return some of the beams by a mask or indices."""
        columns = {name: getattr(self, name)[which] for name in _COLUMNS}
        return ReturnedBeams(**columns, curves=self.curves)

    def late_by(self, lag_s: float) -> ReturnedBeams:
        """Return the beams with the angles logged `lag_s` later; curves are extrapolated at constant speed."""
        joint_rad, speed_rad_s = np.empty(self.range_m.size), np.empty(self.range_m.size)
        for k, curve in enumerate(self.curves):
            mine = self.recording == k
            joint_rad[mine], speed_rad_s[mine] = _joint(curve, self.time_ns[mine] + round(lag_s * 1e9))
        return replace(self, joint_rad=joint_rad, speed_rad_s=speed_rad_s)

    def under(self, x: Float64[ndarray, " parameters"]) -> ReturnedBeams:
        """Return the beams with the time offset of a parameter vector; `self` must have none."""
        return self.late_by(x[LAG[0]]) if x[LAG[0]] else self

    @property
    def direction(self) -> Float64[ndarray, " n"]:
        """+1, -1 or 0 (at rest) for each beam."""
        return np.where(np.abs(self.speed_rad_s) > AT_REST_RAD_S, np.sign(self.speed_rad_s), 0.0)


_COLUMNS = ("range_m", "bearing_rad", "joint_rad", "speed_rad_s", "recording", "place", "time_ns")


def gather(
    recordings: Sequence[Recording], *, one_place: bool, own_body: OwnBody | None = None, gamma_rot_rad: float = 0.0
) -> tuple[ReturnedBeams, dict[str, int]]:
    """Return all beams with a return and an angle, and the counts of dropped ones by reason.

    `one_place`: the scanner did not move between the recordings; `gamma_rot_rad`: axis angle at joint position 0, for
    the self-occlusion mask. Parts of the rotor would be walls that agree with any error.
    """
    ranges, bearings, numbers, times = [], [], [], []
    verdicts = np.zeros(len(Verdict), np.int64)
    curves = [axis_curve(recording.joint_log, at_rest=recording.at_rest)[0] for recording in recordings]
    for k, (recording, curve) in enumerate(zip(recordings, curves, strict=True)):
        for scan in recording.scans():
            time_ns = scan.time_ns
            verdict = beam_verdicts(scan, curve.angle_at(time_ns), own_body, gamma_rot_rad)
            verdicts += np.bincount(verdict, minlength=len(Verdict))
            good = verdict == Verdict.POINT
            ranges.append(scan.range_m[good].astype(float))
            bearings.append(scan.bearing_rad[good])
            numbers.append(np.full(int(good.sum()), k))
            times.append(time_ns[good])
    left_out = {reason.name.lower(): int(verdicts[reason]) for reason in Verdict if reason and verdicts[reason]}
    if not verdicts[Verdict.POINT]:
        raise RecordingError(f"{recordings[0].path}: none of the {verdicts.sum()} beams becomes a point: {left_out}")
    number = np.concatenate(numbers)
    beams = ReturnedBeams(
        range_m=np.concatenate(ranges),
        bearing_rad=np.concatenate(bearings),
        joint_rad=np.zeros(number.size),
        speed_rad_s=np.zeros(number.size),
        recording=number,
        place=np.zeros_like(number) if one_place else number,
        time_ns=np.concatenate(times),
        curves=tuple(curves),
    )
    return beams.late_by(0.0), left_out


def _joint(curve: AxisCurve, time_ns: Int64[ndarray, " n"]) -> tuple[Float64[ndarray, " n"], Float64[ndarray, " n"]]:
    """Return angle and speed of the joint; the curve is extrapolated at its last speed."""
    first_ns, last_ns = int(curve.knot_ns[0]), int(curve.knot_ns[-1])
    half_ns = min(_SPEED_OVER_NS, (last_ns - first_ns) // 2)
    if not half_ns:
        return np.full(time_ns.size, curve.coefficient[0, 0]), np.zeros(time_ns.size)
    near_ns = np.clip(time_ns, first_ns + half_ns, last_ns - half_ns)
    speed_rad_s = (curve.angle_at(near_ns + half_ns) - curve.angle_at(near_ns - half_ns)) / (2 * half_ns / 1e9)
    inside_ns = np.clip(time_ns, first_ns, last_ns)
    return curve.angle_at(inside_ns) + (time_ns - inside_ns) / 1e9 * speed_rad_s, speed_rad_s


def start_vector(angles: AngleSet) -> Float64[ndarray, " parameters"]:
    """Return the parameters of an angle set, shape (COUNT,)."""
    x = np.zeros(COUNT)
    x[0:2] = np.radians(angles.delta_rotvec_rot_deg)
    x[2:4] = np.array(angles.t_rot_laser_mm[:2]) / 1000
    return x


def backlash_rad(servo: str) -> float:
    """Return the full backlash of a servo; the largest of the catalogue if its own is unknown."""
    products = load_catalogue()
    known = next((each for each in products if isinstance(each, Servo) and each.name == servo), None)
    own_deg = None if known is None else known.backlash_deg
    return float(np.radians(most_backlash_deg(products) if own_deg is None else own_deg))


@dataclass(frozen=True, slots=True, eq=False)
class Mount:
    """Designed mount of the laser in the rotation frame."""

    designed: Rotation  # rotation of the angle set without its delta, shape (3, 3)
    along_m: float  # translation along the axis, which is not calibrated
    backlash_rad: float  # of the servo's gear, bound of a backlash that is not estimated

    @staticmethod
    def of(angles: AngleSet) -> Mount:
        """Return the mount of an angle set, without its delta."""
        bare = angles.model_copy(update={"delta_rotvec_rot_deg": (0.0, 0.0)})
        return Mount(bare.R_rot_laser(), angles.t_rot_laser_mm[2] / 1000, backlash_rad(angles.servo))

    def plane(self, x: Float64[ndarray, " parameters"]) -> Floats:
        """Return the first two columns of `exp(delta) R_designed`, and their derivatives, shape (3, 3, 2)."""
        exact = frames.rotvec_to_matrix([x[0], x[1], 0.0]) @ self.designed
        turn = _left_jacobian(np.array([x[0], x[1], 0.0]))
        return np.stack([exact[:, :2], *(np.cross(turn[:, k], exact[:, :2], axisb=0, axisc=0) for k in (0, 1))])


def _left_jacobian(rotvec_rad: Float64[ndarray, " 3"]) -> Float64[ndarray, "3 3"]:
    """Return J with exp(v + dv) = exp(J dv) exp(v) for small dv, shape (3, 3)."""
    angle = float(np.linalg.norm(rotvec_rad))
    K = np.cross(rotvec_rad, np.eye(3), axisb=0, axisc=0)
    a = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    b = (1 - np.sinc(angle / np.pi)) / angle**2 if angle > 1e-4 else 1 / 6
    return np.eye(3) + a * K + b * (K @ K)


def axis_angle(
    x: Float64[ndarray, " parameters"], joint_rad: Float64[ndarray, " n"], direction: Float64[ndarray, " n"]
) -> Float64[ndarray, " n"]:
    """Return psi of each beam, shape (n,)."""
    j = joint_rad
    harmonics = x[5] * np.cos(j) + x[6] * np.sin(j) + x[7] * np.cos(2 * j) + x[8] * np.sin(2 * j)
    return joint_rad + harmonics - 0.5 * x[10] * direction


def beam_rays(
    mount: Mount, x: Float64[ndarray, " parameters"], beams: ReturnedBeams
) -> tuple[Float64[ndarray, "n 3"], Float64[ndarray, "n 3"]]:
    """Return origin and direction of each beam, each shape (n, 3); `beams.joint_rad` must include the lag."""
    psi = axis_angle(x, beams.joint_rad, beams.direction)
    columns = mount.plane(x)[0]
    u = np.multiply.outer(np.cos(beams.bearing_rad), columns[:, 0])
    u += np.multiply.outer(np.sin(beams.bearing_rad), columns[:, 1])
    cos, sin = np.cos(psi), np.sin(psi)
    direction = np.column_stack([cos * u[:, 0] - sin * u[:, 1], sin * u[:, 0] + cos * u[:, 1], u[:, 2]])
    height = np.full(psi.size, mount.along_m)
    origin = np.column_stack([cos * x[2] - sin * x[3], sin * x[2] + cos * x[3], height])
    return origin, direction
