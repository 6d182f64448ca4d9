"""Other people's programs against the emulated devices: one row for each program and model.

    python -m benchmarks.firmware_io.devices.interop [sdk=ULTRA_SIMPLE] [urg=SAMPLES] [ldlidar=SOURCES] [sick=FOLDER]
        [sicktoolbox=EXAMPLES] [dynamixel=EXAMPLES] [python=PYTHON]

`sdk` is the program ultra_simple of rplidar_sdk, `urg` the folder samples/c of urg_library (both built), `ldlidar` the
folder ldlidar_driver of ldlidar_stl_ros2 (compiled here, which needs g++), `sick` a checkout of sick_scan_xd with its
shared library in build_linux, `sicktoolbox` a folder with its examples, `dynamixel` a folder with the C++ examples of
DynamixelSDK, named as `read_write_1.0`, whose device is `ttyUSB0` in the working folder, `python` an interpreter with
the packages rplidar-roboticia, pyrplidar, lds2d, ftservo-python-sdk, rustypot and dynamixel-sdk. Each lidar stands
before a wall whose distance is known in every direction; what a program prints is compared with that. Each servo is
moved by half a radian, or as an example does. A row fails if a program prints too little or something else.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from pkgutil import resolve_name

import numpy as np

from scanwright.design.arrays import Floats, Times
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.firmware_io.emulators.servo.emulator import ServoEmulator
from scanwright.firmware_io.emulators.slamtec.models import IDENTITIES
from scanwright.firmware_io.lidar.families import family_of

_RUN_S = 10.0
_FEWEST = 1000  # points
_WITHIN_MM = 10.0  # of the wall, at the median
_BAUDS = {"STS3215": 1_000_000, "AX-12A": 1_000_000}  # from the factory; the others have 57,600
_SERVO_WITHIN_RAD = 0.03  # AX-12A: compliance of 1 step, and a load of none
_RPLIDARS = tuple(IDENTITIES)
_USUAL = ("chrt", "--other", "0")  # priority of the programs; emulators go ahead, as devices have their own processor

_NO_DTR = "import sys, serial\nserial.Serial._update_dtr_state = lambda self: None  # a pseudo-terminal has none\n"
_ROBOTICIA = """
from rplidar import RPLidar
lidar = RPLidar(sys.argv[1], int(sys.argv[2]))
for _, _, angle, mm in lidar.iter_measures("KIND", max_buf_meas=False):
    print(angle, mm, flush=True)
"""
_PYRPLIDAR = """
from pyrplidar import PyRPlidar
lidar = PyRPlidar()
lidar.connect(sys.argv[1], int(sys.argv[2]))
lidar.set_motor_pwm(660)
lidar.get_scan_modes()
mode = lidar.get_scan_mode_typical()
scan = lidar.start_scan_express(mode) if mode else lidar.start_scan()
for point in scan():
    print(point.angle, point.distance, flush=True)
"""
_LDS2D = """
from lds2d import Lidar
with Lidar.open(sys.argv[3].replace(" ", "-"), sys.argv[1], int(sys.argv[2])) as lidar:
    lidar.start()
    for point in lidar.points():
        print(point.angle_deg, point.dist_mm, flush=True)
"""
_SICK_SCAN = """
import numpy as np
sys.path.append(sys.argv[1] + "/python/api")
from sick_scan_api import *
def show(_, message):
    cloud = message.contents
    rows = np.ctypeslib.as_array(cloud.data.buffer, (cloud.height * cloud.width, cloud.point_step))
    x, y = rows.view(np.float32)[:, :2].T
    for angle, mm in zip(np.degrees(np.arctan2(y, x)), 1000 * np.hypot(x, y)):
        print("%.3f %.1f" % (angle, mm), flush=True)
library = SickScanApiLoadLibrary([sys.argv[1] + "/build_linux/"], "libsick_scan_xd_shared_lib.so")
handle = SickScanApiCreate(library)
launch = "sick_" + {"T": "tim_5xx", "1": "lms_1xx", "5": "lms_5xx"}[sys.argv[4].removeprefix("LMS")[0]] + ".launch"
words = (sys.argv[1] + "/launch/" + launch, "hostname:=" + sys.argv[2], "port:=" + sys.argv[3])
SickScanApiInitByLaunchfile(library, handle, " ".join(words))
callback = SickScanPointCloudMsgCallback(show)
SickScanApiRegisterCartesianPointCloudMsg(library, handle, callback)
time.sleep(60)  # the callback prints until the benchmark ends this program
"""
_FTSERVO = """
from scservo_sdk import PortHandler, sms_sts
port = PortHandler(sys.argv[1])
port.openPort(), port.setBaudRate(int(sys.argv[2]))
servo = sms_sts(port)
before = servo.ReadPos(1)[0]
servo.WritePosEx(1, before + 326, 2000, 50)
time.sleep(2)
print(servo.ReadPos(1)[0] - before)
"""
_RUSTYPOT = """
import rustypot
kind = {"STS3215": "Sts3215", "MX-64R": "Mx", "AX-12A": "Ax"}.get(sys.argv[3], "Xl430")
servo = getattr(rustypot, kind + "PyController")(sys.argv[1], int(sys.argv[2]), 0.5)
before = servo.sync_read_present_position([1])[0] if kind == "Xl430" else servo.read_present_position(1)
before = before[0] if isinstance(before, list) else before
servo.write_torque_enable(1, 1 if kind == "Xl430" else True)
servo.write_goal_position(1, before + (326 if kind == "Xl430" else 0.5))  # one of them counts
time.sleep(2)
print(before)
"""
_DYNAMIXEL = """
from dynamixel_sdk import PacketHandler, PortHandler
port = PortHandler(sys.argv[1])
port.openPort(), port.setBaudRate(int(sys.argv[2]))
torque, goal, size = (24, 30, 2) if sys.argv[3] in ("MX-64R", "AX-12A") else (64, 116, 4)
bus = PacketHandler(2.0 if size == 4 else 1.0)
bus.write1ByteTxRx(port, 1, torque, 1)
middle, step = (512, 0.00511) if sys.argv[3] == "AX-12A" else (2048, 0.001534)
getattr(bus, f"write{size}ByteTxRx")(port, 1, goal, middle + round(0.5 / step))
time.sleep(2)
print(bus.ping(port, 1))
"""
_SERVOS = {
    "ftservo-python-sdk": (_FTSERVO, ("STS3215",)),
    "rustypot": (_RUSTYPOT, ("STS3215", "XM430-W350", "MX-64R", "AX-12A")),
    "dynamixel-sdk": (_DYNAMIXEL, ("XM430-W350", "MX-64R", "AX-12A")),
}
_EXAMPLES = (  # of DynamixelSDK: program, model, keys that it waits for, and the end of what it prints
    ("ping_1.0", "MX-64R", "", "ping Succeeded. Dynamixel model number : 310"),
    ("read_write_1.0", "MX-64R", "aa\x1b", "GoalPos:4000  PresPos:39"),
    ("bulk_read_1.0", "MX-64R", "aa\x1b", "[ID:002] Is Moving :"),
    ("sync_write_1.0", "MX-64R", "aa\x1b", "[ID:002] GoalPos:1000  PresPos:99"),
    ("reset_1.0", "MX-64R", "", "factoryReset Success!"),
    ("ping_2.0", "XM430-W350", "", "ping Succeeded. Dynamixel model number : 1020"),
    ("broadcast_ping_2.0", "XM430-W350", "", "[ID:002]"),
    ("read_write_2.0", "XL430-W250", "aa\x1b", "Goal Position:4095  Present Position:40"),
    ("read_write_2.0", "XM540-W270", "aa\x1b", "Goal Position:4095  Present Position:40"),
    ("reboot_2.0", "XL430-W250", "a", "reboot Succeeded"),
    ("factory_reset_2.0", "XL430-W250", "", "factoryReset Success!"),
    ("clear_multi_turn_2.0", "XL430-W250", "a" * 200 + " \x1b", "Present Position has been reset. :"),
)
_LDLIDAR = """
#include <chrono>
#include <cstdio>
#include <thread>
#include "ldlidar_driver.h"
int main(int, char **argv) {
  ldlidar::LDLidarDriver driver;
  driver.RegisterGetTimestampFunctional([] {
    return (uint64_t)std::chrono::steady_clock::now().time_since_epoch().count();
  });
  driver.EnableFilterAlgorithnmProcess(false);
  if (!driver.Start(ldlidar::LDType::LD_19, argv[1], atoi(argv[2]))) return 1;
  for (;;) {
    ldlidar::Points2D points;
    if (driver.GetLaserScanData(points, 1500) == ldlidar::LidarStatus::NORMAL)
      for (auto &point : points) printf("%f %d\\n", point.angle, point.distance);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}
"""


@dataclass(frozen=True, slots=True)
class Client:
    """A program.

    Attributes:
        name: of it.
        models: that it should run with.
        command: its arguments, in which PORT, HOST, TCP, BAUD and MODEL stand for those of an emulator.
        pattern: matches angle [deg] and distance [mm] in what it prints, or a distance straight ahead.
        behind_mm: distance of a second echo from the wall, if that is what the pattern matches.
    """

    name: str
    models: tuple[str, ...]
    command: tuple[str, ...]
    pattern: str = r"^(-?[\d.]+) ([\d.]+)$"
    behind_mm: float = 0.0


def wall_mm(bearing_rad: Floats) -> Floats:
    """Distance of the wall."""
    return 2000.0 + 1000.0 * np.sin(bearing_rad)


def _ranging(time_ns: Times, bearing_rad: Floats) -> tuple[Floats, Floats]:
    return wall_mm(bearing_rad) / 1e3, np.full(time_ns.size, 200.0)


def _baud(model: str) -> int:
    return IDENTITIES[model].baud if model in IDENTITIES else 921_600 if model == "STL27L" else 230_400


def clients(paths: dict[str, str], folder: Path) -> Iterator[Client]:
    """Return the programs at the paths that are given; `folder` is for what must be compiled."""
    if program := paths.get("sdk"):
        pattern = r"theta: ([\d.]+) Dist: ([\d.]+)"
        yield Client("rplidar_sdk", _RPLIDARS, (program, "--channel", "--serial", "PORT", "BAUD"), pattern)
    if python := paths.get("python"):
        scripts = {
            "rplidar-roboticia, normal": (_ROBOTICIA.replace("KIND", "normal"), _RPLIDARS),
            "rplidar-roboticia, express": (_ROBOTICIA.replace("KIND", "express"), _RPLIDARS[:4]),
            "pyrplidar": (_PYRPLIDAR, (*_RPLIDARS[:3], "RPLIDAR C1")),  # 0.1.2 swaps the bytes of dense capsules
            "lds2d": (_LDS2D, ("LD06", "LD19", "RPLIDAR A1", "RPLIDAR C1")),
        }
        for name, (script, models) in scripts.items():
            yield Client(name, models, (python, "-c", _NO_DTR + script, "PORT", "BAUD", "MODEL"))
    if samples := paths.get("urg"):
        usb, ahead = ("URG-04LX", "URG-04LX-UG01", "UTM-30LX"), r"^()(\d+) \[mm\]"
        for name in ("get_distance", "get_distance_handshake", "sync_time_stamp"):
            pattern = ahead if name != "sync_time_stamp" else r"^()()\d+"
            yield Client(f"urg_library, {name}", usb, (str(Path(samples, name)), "-s", "PORT"), pattern)
        for name in ("get_multiecho", "get_multiecho_intensity"):
            command = (str(Path(samples, name)), "-s", "PORT")
            yield Client(f"urg_library, {name}", ("UTM-30LX-EW",), command, r"^()\d+, (\d+), 0, ", 500.0)
    if checkout := paths.get("sick"):
        words = (sys.executable, "-c", "import sys, time" + _SICK_SCAN, checkout, "HOST", "TCP", "MODEL")
        yield Client("sick_scan_xd", ("TiM551", "TiM561", "TiM571", "LMS111", "LMS511"), words)
    if examples := paths.get("sicktoolbox"):
        for name in ("lms2xx_simple_app", "lms2xx_set_variant"):
            program = str(Path(examples, name))
            yield Client(f"sicktoolbox, {name}", ("LMS 200",), (program, "PORT"), r"()()Num\. Values: \d+")
    if sources := paths.get("ldlidar"):
        (folder / "main.cpp").write_text(_LDLIDAR)
        includes = [f"-I{path}" for path in Path(sources, "include").iterdir()]
        units = [str(path) for path in Path(sources, "src").rglob("*.cpp")]
        program = str(folder / "ldlidar")
        subprocess.run(
            ["g++", "-O1", "-pthread", "-include", "pthread.h", *includes, folder / "main.cpp", *units, "-o", program],
            check=True,
        )
        yield Client("ldlidar", ("LD06", "LD19"), (program, "PORT", "BAUD"))


def result(client: Client, model: str, folder: Path) -> tuple[bool, str]:
    """Run a program against a model; whether it works, and a note."""
    lidar, log = load_catalogue().get(model, Lidar), folder / "log"

    def two_echoes(time_ns: Times, bearing_rad: Floats) -> tuple[Floats, Floats]:
        range_m, bright = _ranging(time_ns, bearing_rad)
        return np.stack([range_m, range_m + client.behind_mm / 1e3]), np.stack([bright, bright])

    emulator = resolve_name(family_of(model).emulator)(lidar, two_echoes if client.behind_mm else _ranging, 0)
    with emulator, log.open("w") as out:
        host, _, tcp = emulator.address.partition(":")
        values = {"PORT": emulator.port, "HOST": host, "TCP": tcp, "BAUD": str(_baud(model)), "MODEL": model}
        command = [*_USUAL, "stdbuf", "-oL", *(values.get(part, part) for part in client.command)]
        program = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT, cwd=folder)
        with suppress(subprocess.TimeoutExpired):
            program.wait(_RUN_S)
        program.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            program.wait(5.0)
        program.kill()
        program.wait()
    text = log.read_text(errors="replace")
    found = re.findall(client.pattern, text, re.MULTILINE)
    last = (text.strip().splitlines() or ["nothing printed"])[-1][:60]
    if found and not found[0][1]:
        return len(found) > 3, f"{len(found)} answers"
    points = np.array([(float(angle or 0), float(mm)) for angle, mm in found]).reshape(-1, 2)
    points = points[points[:, 1] > 0]
    if found and not found[0][0]:
        off_mm = float(np.abs(points[:, 1] - client.behind_mm - wall_mm(np.zeros(1))).max())
        return off_mm < _WITHIN_MM and len(points) > 3, f"{len(points)} scans, {off_mm:.0f} mm off the wall at most"
    if len(points) < _FEWEST:
        return False, f"{len(points)} points: {last}"
    off = [np.median(np.abs(points[:, 1] - wall_mm(sign * np.radians(points[:, 0])))) for sign in (-1, 1)]
    return min(off) < _WITHIN_MM, f"{len(points):,} points, {min(off):.1f} mm off the wall at the median"


def moved(python: str, script: str, model: str) -> tuple[bool, str]:
    """Let a program move an emulated servo by half a radian; whether it did, and a note."""
    with ServoEmulator(model) as servo:
        baud = str(_BAUDS.get(model, 57_600))
        command = [*_USUAL, python, "-c", "import sys, time" + script, servo.port, baud, model]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
        turned_rad = abs(servo.axis.motion(time.monotonic_ns()).angle_rad)
    note = f"the horn turned by {turned_rad:.3f} rad"
    if ended.returncode:
        note = (ended.stderr.strip().splitlines() or ["it failed"])[-1][:60]
    return ended.returncode == 0 and abs(turned_rad - 0.5) < _SERVO_WITHIN_RAD, note


def example(program: Path, model: str, keys: str, end: str) -> tuple[bool, str]:
    """Run an example of DynamixelSDK on two servos; whether it came to its end, and a note."""
    protocol = program.name[-3:]
    with ServoEmulator(model, protocol, others=[(model, 2)]) as servo, tempfile.TemporaryDirectory() as folder:
        Path(folder, "ttyUSB0").symlink_to(servo.port)
        try:
            ended = subprocess.run(
                [*_USUAL, program], input=keys, capture_output=True, text=True, cwd=folder, timeout=30
            )
        except subprocess.TimeoutExpired:
            return False, "it did not end in 30 s"
    lost = ended.stdout.count("There is no status packet")  # on a busy computer it waits no longer than 34 ms
    return end in ended.stdout, f"{len(ended.stdout.splitlines())} lines, {lost} replies late"


def servo_rows(paths: dict[str, str]) -> Iterator[tuple[str, str, tuple[bool, str]]]:
    """Program, model and result of each servo program whose path is given."""
    for name, (script, models) in _SERVOS.items() if "python" in paths else ():
        for model in models:
            yield name, model, moved(paths["python"], script, model)
    for name, model, keys, end in _EXAMPLES if "dynamixel" in paths else ():
        yield f"DynamixelSDK, {name}", model, example(Path(paths["dynamixel"], name), model, keys, end)


def main() -> int:
    """Run every program whose path is given, and print a table."""
    paths = dict(argument.split("=", 1) for argument in sys.argv[1:])
    failed = False
    with suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    print("| program | model | works | in 10 s |\n| --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for client in clients(paths, Path(folder)):
            for model in client.models:
                works, note = result(client, model, Path(folder))
                failed |= not works
                print(f"| {client.name} | {model} | {'yes' if works else 'no'} | {note} |", flush=True)
    for name, model, (works, note) in servo_rows(paths):
        failed |= not works
        print(f"| {name} | {model} | {'yes' if works else 'no'} | {note} |", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
