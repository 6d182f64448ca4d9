"""A whole scan by a clock that goes forward only where its threads wait: drivers, emulated devices, and the guard."""

import random
from contextlib import nullcontext
from types import SimpleNamespace

from virtual_bus import VirtualServo
from virtual_line import VirtualLine
from virtual_time import VirtualTime

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.motion import Spin
from scanwright.firmware_io.emulators.world import range_model, room, scene_ranging
from scanwright.firmware_io.lidar import sensor_line
from scanwright.firmware_io.lidar.scip import driver as scip
from scanwright.firmware_io.scan import acquire, axis_thread, doctor
from scanwright.firmware_io.scan.plan import plan_scan

_ON_THE_CLOCK = ("scanwright.firmware_io.lidar", "scanwright.firmware_io.servo", "scanwright.firmware_io.scan")


class VirtualScanner:
    """The devices of an angle set, in the furnished room.

    Attributes:
        clock: `VirtualTime`.
        lidar: `VirtualLine`.
        servo: `VirtualServo`.
    """

    def __init__(self, angles, seed=0, angle_rad=0.0):
        self.clock = VirtualTime()
        self.servo = VirtualServo(angles.servo, clock=self.clock, seed=seed, angle_rad=angle_rad)
        self.servo.set_up(spins=isinstance(angles.motion, Spin))
        lidar = load_catalogue().get(angles.sensor, Lidar)
        ranging = scene_ranging(room(None), angles, self.servo.servo.axis.angle_rad, range_model(lidar), seed)
        self.lidar = VirtualLine(angles.sensor, ranging, self.clock)
        if angles.sensor.startswith("LMS 2"):
            self.lidar.machine.baud = 500_000  # this line has no speed that a driver could change
        self.servo.sleep(0.01)

    def install(self, monkeypatch):
        """Put devices and clock in the place of the real ones."""
        self.clock.put_in_place_of_time(monkeypatch, *_ON_THE_CLOCK)
        for name in ("Event", "Thread", "SimpleQueue"):
            monkeypatch.setattr(axis_thread, name, getattr(self.clock, name))
        monkeypatch.setattr(axis_thread, "random", random.Random(1))
        monkeypatch.setattr(sensor_line, "open_stream", self.lidar.open)
        monkeypatch.setattr(scip, "lidar_ports", list)
        monkeypatch.setattr(doctor, "ThreadPoolExecutor", lambda _: nullcontext(SimpleNamespace(map=map)))
        self.servo.install(monkeypatch)
        return self

    def at(self, seconds, happens):
        """Let something happen later."""

        def later():
            self.clock.sleep(seconds)
            happens()

        self.clock.Thread(target=later, daemon=True).start()

    def scan(self, out, when=("", lambda: None), **more):
        """Scan; something happens when a step begins with some words, once the recording runs if they are "running"."""
        words, happens = when
        due = [happens]

        def progress(step, fraction=None):
            if due and (fraction is not None if words == "running" else step.startswith(words)):
                due.pop()()

        return acquire.acquire(plan_scan(out, lidar="lidar", servo="servo", **more), progress)

    def stands(self):
        return abs(self.servo.servo.axis.motion(self.clock.now_ns).rate_rad_s) < 0.02
