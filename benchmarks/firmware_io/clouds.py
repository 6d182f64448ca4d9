"""How fast recordings become clouds, against what robotics uses: `python -m benchmarks.firmware_io.clouds [MINUTES]`.

Four tables, each a ratio of two things measured in turns in one run, with the spread over the rounds. Times are those
of the wall, and of the processor where other programs may run beside:

1. the de-skew kernel against KISS-ICP's (`kiss_icp.preprocess.Preprocessor`) on the same points, and against a plain
   copy of as many bytes as it must move (4 in and 12 out for each point);
2. the same points against the float64 description;
3. the whole command, MCAP to PLY with xyz and intensity, against `mcap_ros2.reader` and NumPy for each scan, with the
   peak memory of both;
4. error against run time of the ways to go between encoder samples.

KISS-ICP moves points by one constant velocity; the kernel does the servo, and with poses the platform too. It gets all
points as one frame, which is its fastest; the kernel gets blocks of 256 scans, where the
command makes 128 at once and holds less.
"""

from __future__ import annotations

import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from kiss_icp.preprocess import Preprocessor
from mcap_ros2.reader import read_ros2_messages

from benchmarks.firmware_io.recordings.deskew import place
from benchmarks.trials.axis import interpolations
from scanwright.design.angles import Angles, AngleSet, load_angles
from scanwright.design.arrays import Floats
from scanwright.firmware_io.assembly.deskew_kernel import place_block
from scanwright.firmware_io.clouds.ply import ply_writer
from scanwright.firmware_io.poses.trajectory import Trajectory
from scanwright.firmware_io.recording.recording import recording_writer
from scanwright.firmware_io.samples import AxisCurve, Block, JointLog, Scan, blocks, straight

ROUNDS = 7
PROGRAM_ROUNDS = 2
BEAMS = 1081
SCANS = 7400  # eight million points
PERIOD_NS = 25_000_000
START_NS = 1_700_000_000_000_000_000
SPEED_RAD_S = math.radians(20)
STEP_RAD = 2 * math.pi / 4096
XYZ_I = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4")])
ANGLES = AngleSet(
    task="benchmark",
    angles_deg=Angles(alpha_rot=10, beta_rot=-55, alpha_laser=-80, beta_laser=75),
    delta_rotvec_rot_deg=(0.3, -0.2),
    t_rot_laser_mm=(4, -3, 2),
    t_world_rot_mm=(20, 0, 140),
    sensor="UTM-30LX",
    servo="MX-64R",
)


def main() -> None:
    """Print the tables."""
    if sys.argv[1:2] == ["--peer"]:
        peer(Path(sys.argv[2]), Path(sys.argv[3]), Path(sys.argv[4]))
        return
    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 10.0
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    kernel()
    command(minutes)
    orders()


def kernel() -> None:
    """Tables 1 and 2."""
    listed = list(blocks(scans(SCANS)))
    curve = straight(joint_log(SCANS * PERIOD_NS / 1e9, 100.0))
    moving = trajectory(SCANS * PERIOD_NS / 1e9, 100.0)
    points = SCANS * BEAMS
    frame = np.concatenate([_laser_points(block) for block in listed])
    stamps = np.linspace(0.0, 1.0, points)
    motion = np.eye(4)
    motion[:3, 3] = 0.5, 0.1, 0.0
    preprocessor = Preprocessor(max_range=1e3, min_range=0.0, deskew=True, max_num_threads=os.cpu_count())
    copied = np.zeros(points * 8, np.uint8), np.ones(points * 8, np.uint8)

    def ours(poses: Trajectory | None) -> None:
        for block in listed:
            place_block(block, curve, ANGLES, poses=poses, with_joint=False)

    wall, busy = in_turns(
        {
            "platform at rest": lambda: ours(None),
            "platform moving": lambda: ours(moving),
            "KISS-ICP": lambda: preprocessor.preprocess(frame, stamps, motion),
            "copy": lambda: _copy(*copied),
        }
    )
    cores = os.cpu_count() or 1
    print(f"\n1. de-skew of {points / 1e6:.1f} million points, float32 out, {ROUNDS} rounds; million points a second:")
    print(f"   {'':20}  best (median)   by processor time, x {cores} cores")
    for name in wall:
        best, median, by_processor = wall[name].min(), np.median(wall[name]), np.median(busy[name]) / cores
        print(
            f"   {name:20} {points / best / 1e6:6.0f} ({points / median / 1e6:.0f}) {points / by_processor / 1e6:12.0f}"
        )
    for name in ("platform at rest", "platform moving"):
        print(f"   {name}: {_ratio(wall['KISS-ICP'], wall[name])} x KISS-ICP, ", end="")
        print(f"by processor time {_ratio(busy['KISS-ICP'], busy[name])}; ", end="")
        print(f"{_ratio(wall['copy'], wall[name], 2)} of the speed of a copy")
    print("\n2. largest difference from the float64 description, ranges up to 30 m")
    for name, poses in (("platform at rest", None), ("platform moving", moving)):
        worst = max(_difference_um(block, curve, poses) for block in listed[::10])
        print(f"   {name:20} {worst:.2f} um")


def command(minutes: float) -> None:
    """Table 3."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        recording, angles = folder / "recording.mcap", folder / "angles.json"
        angles.write_text(ANGLES.to_json(), encoding="utf-8")
        count = round(minutes * 60e9 / PERIOD_NS)
        write(recording, count)
        print(f"\n3. {minutes:g} minutes, {count:,} scans, {recording.stat().st_size / 1e6:.0f} MB of MCAP, to PLY")
        scanwright = "from scanwright.cli.app import run; run()"
        ours = [sys.executable, "-c", scanwright, "assemble", str(recording), "--angles", str(angles)]
        ours += ["-o", str(folder / "ours.ply"), "--columns", "intensity"]
        theirs = [sys.executable, __file__, "--peer", str(recording), str(angles), str(folder / "theirs.ply")]
        run(ours)  # it may have to compile
        rows = np.array([[run(ours), run(theirs)] for _ in range(PROGRAM_ROUNDS)])
        for what, taken in (("assemble", rows[:, 0]), ("reader + NumPy", rows[:, 1])):
            wall, busy, peak_mb = taken.T
            print(
                f"   {what:15} {wall.min():6.2f} s ({np.median(wall):.2f}), of the processor {busy.min():.2f} s ",
                end="",
            )
            print(f"({np.median(busy):.2f}), peak memory {peak_mb.max():.0f} MB")
        print(f"   {_ratio(rows[:, 1, 0], rows[:, 0, 0])} x as fast, ", end="")
        print(f"by processor time {_ratio(rows[:, 1, 1], rows[:, 0, 1])}")


def orders() -> None:
    """Table 4."""
    print("\n4. the axis between encoder samples: 20 deg/s, 4096 steps a turn, 100 samples/s, 1 % ripple, 36 s")
    log = joint_log(36.0, 100.0)
    after_ns = np.linspace(0, log.time_ns[-1] - log.time_ns[0], 400_000).astype(np.int64)
    for way, prepare in interpolations(log).items():
        start = time.perf_counter()
        curve = prepare()
        ready = time.perf_counter()
        angle_rad = curve.angle_at(log.time_ns[0] + after_ns)
        done = time.perf_counter()
        off_rad = angle_rad - truth_rad(after_ns / 1e9)
        rms_rad = float(np.sqrt(np.mean(off_rad**2)))
        print(
            f"   {way:26} rms {math.degrees(rms_rad):.4f} deg = {10_000 * rms_rad:6.2f} mm at 10 m, "
            f"worst {math.degrees(np.abs(off_rad).max()):.4f} deg, {(ready - start) * 1e3:7.2f} ms + "
            f"{(done - ready) / after_ns.size * 1e9:.0f} ns a beam"
        )


def scans(count: int) -> Iterator[Scan]:
    """Scans of a UTM-30LX in no particular room, as whole millimetres."""
    rng = np.random.default_rng(0)
    bearing = np.linspace(0, 6 * math.pi, BEAMS)
    for k in range(count):
        range_m = 8 + 6 * np.sin(bearing + k / 200) + rng.normal(0, 0.01, BEAMS)
        yield Scan(
            stamp_ns=START_NS + k * PERIOD_NS,
            angle_min_rad=float(np.float32(math.radians(-135))),
            angle_increment_rad=float(np.float32(math.radians(0.25))),
            time_increment_s=float(np.float32(PERIOD_NS / 1e9 / 1440)),
            scan_time_s=float(np.float32(PERIOD_NS / 1e9)),
            range_min_m=float(np.float32(0.1)),
            range_max_m=30.0,
            range_m=np.round(range_m, 3).astype(np.float32),
            intensity=rng.integers(500, 4000, BEAMS).astype(np.float32),
        )


def truth_rad(seconds: Floats) -> Floats:
    """What the axis does: constant speed and the ripple of a servo."""
    turned = SPEED_RAD_S * seconds
    return turned + 0.01 * np.sin(turned) / 2 + 0.002 * np.sin(3 * turned)


def joint_log(duration_s: float, rate_hz: float) -> JointLog:
    """What the encoder says, from a second before to a second after."""
    seconds = np.arange(-1.0, duration_s + 1.0, 1 / rate_hz)
    steps = np.rint(truth_rad(seconds - seconds[0]) / STEP_RAD)
    return JointLog(START_NS + np.rint(seconds * 1e9).astype(np.int64), steps * STEP_RAD)


def trajectory(duration_s: float, rate_hz: float) -> Trajectory:
    """A platform that drives a slalom."""
    seconds = np.arange(-1.0, duration_s + 1.0, 1 / rate_hz)
    yaw = 0.4 * np.sin(seconds)
    nothing = np.zeros_like(yaw)
    return Trajectory(
        START_NS + np.rint(seconds * 1e9).astype(np.int64),
        np.stack([seconds * 0.5, np.sin(seconds), nothing], axis=1),
        np.stack([nothing, nothing, np.sin(yaw / 2), np.cos(yaw / 2)], axis=1),
    )


def write(path: Path, count: int) -> None:
    """A recording of that many scans."""
    log = joint_log(count * PERIOD_NS / 1e9, 100.0)
    samples = iter(zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True))
    time_ns, position_rad = next(samples)
    with recording_writer(path, {"source": "benchmark"}) as writer:
        for scan in scans(count):
            while time_ns <= scan.stamp_ns:
                writer.joint(time_ns, position_rad)
                time_ns, position_rad = next(samples)
            writer.scan(scan)
        for time_ns, position_rad in samples:
            writer.joint(time_ns, position_rad)


def peer(recording: Path, angles_file: Path, out: Path) -> None:
    """What one writes without us: the ROS 2 reader of mcap, and NumPy on each scan."""
    angles = load_angles(angles_file)
    T_world_rot, T_rot_laser = angles.T_world_rot(0.0), angles.T_rot_laser()
    times, positions = [], []
    for message in read_ros2_messages(str(recording), topics=["/joint_states"]):
        times.append(message.ros_msg.header.stamp.sec * 10**9 + message.ros_msg.header.stamp.nanosec)
        positions.append(message.ros_msg.position[0])
    since_s = (np.array(times) - times[0]) / 1e9
    with ply_writer(out, XYZ_I, []) as cloud:
        for message in read_ros2_messages(str(recording), topics=["/scan"]):
            scan = message.ros_msg
            range_m = np.array(scan.ranges)
            range_m[(range_m < scan.range_min) | (range_m > scan.range_max)] = np.nan
            beam = np.arange(range_m.size)
            bearing = scan.angle_min + scan.angle_increment * beam
            first_s = (scan.header.stamp.sec * 10**9 + scan.header.stamp.nanosec - times[0]) / 1e9
            joint = np.interp(first_s + scan.time_increment * beam, since_s, positions, np.nan, np.nan)
            laser = np.stack([range_m * np.cos(bearing), range_m * np.sin(bearing), np.zeros_like(range_m)], axis=1)
            x, y, z = (laser @ T_rot_laser[:3, :3].T + T_rot_laser[:3, 3]).T
            cos, sin = np.cos(joint), np.sin(joint)
            turned = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
            world = turned @ T_world_rot[:3, :3].T + T_world_rot[:3, 3]
            rows = np.empty(range_m.size, XYZ_I)
            rows["x"], rows["y"], rows["z"] = world.T
            rows["intensity"] = scan.intensities
            cloud.write(rows)


def run(words: list[str]) -> tuple[float, float, float]:
    """Seconds of the wall and of the processor, and peak memory [MB], of a program."""
    # a process of its own for each, because the system tells the largest of all children
    script = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL); "
    script += "used = resource.getrusage(resource.RUSAGE_CHILDREN); "
    script += "print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)"
    start = time.perf_counter()
    # as installed: without its compiled files Python would spend a third of the time on compiling modules
    own = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    done = subprocess.run([sys.executable, "-c", script, *words], check=True, capture_output=True, text=True, env=own)
    wall = time.perf_counter() - start
    busy, peak_mb = map(float, done.stdout.split())
    return wall, busy, peak_mb


def in_turns(ways: dict[str, Callable[[], object]]) -> tuple[dict[str, Floats], ...]:
    """Seconds of the wall and of the processor, for each way in each round; one round before is not counted."""
    wall: dict[str, list[float]] = {name: [] for name in ways}
    busy: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(ROUNDS + 1):
        for name, way in ways.items():
            start, start_busy = time.perf_counter(), time.process_time()
            way()
            wall[name].append(time.perf_counter() - start)
            busy[name].append(time.process_time() - start_busy)
    return tuple({name: np.array(taken[1:]) for name, taken in seconds.items()} for seconds in (wall, busy))


def _laser_points(block: Block) -> Floats:
    bearing = block.first.bearing_rad
    r = block.range_m.astype(float)
    return np.stack([r * np.cos(bearing), r * np.sin(bearing), np.zeros_like(r)], axis=2).reshape(-1, 3)


def _copy(target: np.ndarray, source: np.ndarray) -> None:
    """Copy on all cores."""
    cores = os.cpu_count() or 1
    bounds = [source.size * i // cores for i in range(cores + 1)]
    with ThreadPoolExecutor(cores) as pool:
        list(
            pool.map(
                lambda i: np.copyto(target[bounds[i] : bounds[i + 1]], source[bounds[i] : bounds[i + 1]]), range(cores)
            )
        )


def _difference_um(block: Block, curve: AxisCurve, poses: Trajectory | None) -> float:
    got = place_block(block, curve, ANGLES, poses=poses).points_m
    listed = [
        Scan(
            **{
                **{name: getattr(block.first, name) for name in Scan.__slots__},
                "stamp_ns": int(stamp_ns),
                "range_m": row,
            }
        )
        for stamp_ns, row in zip(block.stamp_ns, block.range_m, strict=True)
    ]
    described = np.stack([placed.points_m for placed in place(listed, curve, ANGLES, poses=poses)])
    return float(np.nanmax(np.linalg.norm(got - described, axis=2))) * 1e6


def _ratio(slow: Floats, fast: Floats, digits: int = 1) -> str:
    """Ratio of the best times, and its spread from round to round."""
    each = slow / fast
    return f"{slow.min() / fast.min():.{digits}f} ({each.min():.{digits}f} .. {each.max():.{digits}f})"


if __name__ == "__main__":
    main()
