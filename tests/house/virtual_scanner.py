"""A whole scan by a clock that goes forward only where its threads wait: drivers, emulated devices, and the guard."""

import random
from contextlib import nullcontext
from types import SimpleNamespace

from virtual_bus import VirtualBus
from virtual_line import VirtualLine
from virtual_time import VirtualTime

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.motion import Spin
from scanwright.firmware_io.emulators.world import looking, range_model, room
from scanwright.firmware_io.lidar import sensor_line
from scanwright.firmware_io.lidar.scip import driver as scip
from scanwright.firmware_io.scan import acquire, axis_thread, doctor
from scanwright.firmware_io.scan.plan import plan_scan
from scanwright.firmware_io.servo import guard, servo
from scanwright.firmware_io.servo.bus import serial_line

_ON_THE_CLOCK = ("scanwright.firmware_io.lidar", "scanwright.firmware_io.servo", "scanwright.firmware_io.scan")


class VirtualScanner:
    """The devices of an angle set, in the furnished room.

    Attributes:
        clock: `VirtualTime`.
        lidar: `VirtualLine`.
        servo: `VirtualBus`.
    """

    def __init__(self, angles, seed=0, angle_rad=0.0):
        self.clock = VirtualTime()
        self.servo = VirtualBus(angles.servo, clock=self.clock, seed=seed, angle_rad=angle_rad)
        self.servo.set_up(spins=isinstance(angles.motion, Spin))
        lidar = load_catalogue().get(angles.sensor, Lidar)
        ranging = looking(room(None), angles, self.servo.servo.axis.angle_rad, range_model(lidar), seed)
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
        monkeypatch.setattr(serial_line, "open_serial_port", self.servo.open)
        monkeypatch.setattr(doctor, "ThreadPoolExecutor", lambda _: nullcontext(SimpleNamespace(map=map)))
        monkeypatch.setattr(servo, "Guard", lambda _, *packet_and_answer: VirtualGuard(self.servo, *packet_and_answer))
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


class VirtualGuard:
    """`guard.Guard`, which acts when somebody looks: at the time at which the process would have."""

    def __init__(self, bus, packet, _answer):
        self._bus, self._packet, self._turns, self._heard_ns, self._acted = bus, packet, False, 0, False

    def turning(self):
        return self._heard(turns=True)

    beat = turning

    def resting(self):
        return self._heard(turns=False)

    def dismiss(self, at_rest):
        if not at_rest and not self._acted:
            self._act(self._bus.now_ns)
        return at_rest or self._stopped

    def _heard(self, turns):
        silent_until_ns = self._heard_ns + round(guard.SILENCE_S * 1e9)
        if self._turns and not self._acted and self._bus.now_ns > silent_until_ns:
            self._act(silent_until_ns)
        self._turns, self._heard_ns = turns, self._bus.now_ns
        return not self._acted

    def _act(self, time_ns):
        self._acted, self._stopped = True, self._bus.hears()
        if self._stopped:
            self._bus.serve(self._packet, time_ns)
