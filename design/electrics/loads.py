"""The current of each device, and the fused branch that supplies it."""

from __future__ import annotations

from dataclasses import dataclass

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.electrics.network import Branch, Drop
from scanwright.design.electrics.sizing import CONVERTER, RING_OHM, fuse_for, wire_drop_v, wire_for
from scanwright.design.scanner import Scanner

SUPPLY_V = 12.0
COMPUTER_W = 15.0  # a small computer with its USB devices, assumed
COMPUTER_V = 5.0
UNKNOWN_A = 1.0  # a device whose current is not in the catalogue, assumed
LEADS_M = 1.0  # length of the wires of each branch, assumed
CHANGER = {5.0: "step-down 12 V to 5 V", 24.0: "step-up 12 V to 24 V"}


@dataclass(frozen=True, slots=True)
class ElectricLoad:
    """A device and the current that it draws."""

    name: str  # of its box
    title: str  # its heading
    volts: float  # nominal supply voltage
    continuous_a: float  # in operation
    busy_a: float  # largest current for longer than a moment: the voltage must stay in its bounds
    peak_a: float  # largest current, inrush included: circuits, fuse, converter and supply carry it
    bounds_v: tuple[float, float] | None = None  # lowest and highest voltage that its maker allows
    behind_ring: bool = False  # whether its current passes the slip ring

    @property
    def set_v(self) -> float:
        """Voltage of its converter: the middle of its bounds, since the wires drop some."""
        if self.volts == SUPPLY_V or self.bounds_v is None:
            return self.volts
        return max(self.volts, round(sum(self.bounds_v) / 2, 1))

    def lost_v(self, mm2: float) -> float:
        """Return the voltage drop of its wires and the ring."""
        return wire_drop_v(self.busy_a, mm2, LEADS_M) + (2 * self.busy_a * RING_OHM if self.behind_ring else 0.0)

    @property
    def from_supply(self) -> float:
        """Amperes at the supply for one ampere of the device."""
        return 1.0 if self.volts == SUPPLY_V else self.set_v / SUPPLY_V / CONVERTER


def loads_of(scanner: Scanner) -> list[ElectricLoad]:
    """Return the devices of a scanner that the supply feeds: not a lidar that USB feeds."""
    amps = COMPUTER_W / COMPUTER_V
    computer = ElectricLoad("computer", "computer", COMPUTER_V, amps / 2, amps, amps)
    loads = [_servo_load(scanner.servo), computer]
    if scanner.lidar.link != "usb-powered":
        loads.insert(0, _lidar_load(scanner.lidar, behind_ring=scanner.slip_ring is not None))
    return loads


def _lidar_load(lidar: Lidar, *, behind_ring: bool) -> ElectricLoad:
    busy, volts = lidar.peak_a or UNKNOWN_A, _fed_with(lidar.supply_v)
    continuous, peak = lidar.current_a or busy, most_a(lidar)
    return ElectricLoad("lidar", lidar.name, volts, continuous, busy, peak, lidar.supply_v, behind_ring)


def most_a(lidar: Lidar) -> float:
    """Return the largest current of a lidar, inrush included."""
    return max(lidar.peak_a or UNKNOWN_A, lidar.inrush_a or 0.0)


def _servo_load(servo: Servo) -> ElectricLoad:
    """Return the load of a servo; its continuous current is that of its continuous torque, a fifth of the stall."""
    stall = servo.stall_a or UNKNOWN_A
    volts = _fed_with(servo.supply_v)
    peak = stall * volts / servo.rated_v
    return ElectricLoad("servo", servo.name, volts, (servo.idle_a or 0.0) + peak / 5, peak, peak, servo.supply_v)


def _fed_with(supply_v: tuple[float, float] | None) -> float:
    """Return the supply's voltage if the device accepts it, else that of a converter."""
    if supply_v is None or supply_v[0] <= SUPPLY_V <= supply_v[1]:
        return SUPPLY_V
    return next((volts for volts in CHANGER if supply_v[0] <= volts <= supply_v[1]), SUPPLY_V)


def branch_of(number: int, load: ElectricLoad) -> Branch:
    """Return its branch: a fuse for its peak, and wires thick enough for its lowest voltage."""
    peak = load.peak_a * load.from_supply
    fuse = fuse_for(peak)
    least_v = 0.0 if load.bounds_v is None else load.bounds_v[0]
    mm2 = wire_for(fuse, lambda mm2: load.set_v - load.lost_v(mm2) >= least_v)
    return Branch(f"F{number}", load.title, load.continuous_a * load.from_supply, peak, fuse, mm2)


def drops_of(loads: list[ElectricLoad], branches: list[Branch]) -> list[Drop]:
    """Return the voltage at each device whose bounds are known."""
    return [
        Drop(load.title, load.set_v - load.lost_v(branch.mm2), load.set_v, *load.bounds_v)
        for load, branch in zip(loads, branches, strict=True)
        if load.bounds_v is not None
    ]
