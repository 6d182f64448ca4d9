"""A lidar's machine behind a line whose clock goes forward only where somebody waits."""

from collections import deque
from pkgutil import resolve_name

import pytest
from virtual_time import OnClock

from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.emulators.lidar_line import _AHEAD_NS
from scanwright.firmware_io.lidar.families import family_of

_BUFFER_NS = 50_000_000  # of a line that nobody reads


class VirtualLine(OnClock):
    """The machine of an emulator behind a stream of the drivers' shape, and the clock of both."""

    def __init__(self, model, ranging, clock=None):
        self.model = model
        super().__init__(clock)
        lidar = load_catalogue().get(model, Lidar)
        make = resolve_name(family_of(model).emulator)
        with pytest.MonkeyPatch.context() as patch:
            self.clock.put_in_place_of_time(patch, "scanwright.firmware_io.emulators")
            self.machine = make(lidar, ranging, 0).machine
        self.plugged = True
        self.damage = deque()  # what happens to the next packets
        self._scanning = self.machine.scanning
        self._received = b""
        self._coming = deque()  # when, and what

    def unplug(self):
        self.plugged = False
        self._coming.clear()

    def open(self, address):
        if not self.plugged:
            raise DeviceError(f"{address}: no such port")
        return self

    def write(self, data):
        self._here()
        told, self._received = self.machine.receive(self._received + data, self.now_ns)
        if self.machine.scanning is not self._scanning:
            self._scanning = self.machine.scanning
            self._coming.clear()
        if told:
            self._coming.append((self.now_ns, told))

    def read(self, timeout_s):
        self._here()
        end_ns = self.now_ns + max(round(timeout_s * 1e9), 0)
        self.machine.skip_to(self.now_ns - _BUFFER_NS)
        while not (self._coming and self._coming[0][0] <= end_ns) and self.machine.next_ns() <= end_ns:
            self.now_ns = max(self.now_ns, self.machine.next_ns() - _AHEAD_NS)  # nobody knows where the axis is then
            self._here()
            for sent_ns, packet in self.machine.next_packets():
                self._coming.append((sent_ns, self.damage.popleft()(packet) if self.damage else packet))
        if not self._coming or self._coming[0][0] > end_ns:
            self.now_ns = max(end_ns, self.now_ns + 1000)  # a look takes its time
            return b""
        sent_ns, data = self._coming.popleft()
        self.now_ns = max(self.now_ns, sent_ns)
        return data

    def close(self):
        self._coming.clear()

    def _here(self):
        if not self.plugged:
            raise OSError("unplugged")
