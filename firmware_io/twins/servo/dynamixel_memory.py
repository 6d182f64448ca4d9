"""Control tables of the twins: every entry with its factory value, as the e-manual lists them."""

from __future__ import annotations

from dataclasses import dataclass, field

# Errors of a request, as protocol 2.0 numbers them; 1.0 knows only some (see `ServoTwin`).
RANGE, LENGTH, ACCESS = 4, 5, 7


@dataclass(frozen=True, slots=True)
class TableItem:
    """One entry; a writable one takes counts from `low` to `high`."""

    address: int
    size: int
    value: int
    low: int = 0
    high: int = 0
    writable: bool = False


def _rw(address: int, size: int, value: int, high: int | None = None, low: int = 0) -> TableItem:
    return TableItem(address, size, value, low, (1 << 8 * size) - 1 if high is None else high, True)


def _ro(address: int, size: int, value: int = 0) -> TableItem:
    return TableItem(address, size, value)


def _signed(address: int, size: int, bound: int) -> TableItem:
    return TableItem(address, size, 0, -bound, bound, True)


def _protocol_1(
    number: int, *, baud: int, last: int, hot: int, volts: tuple[int, int], firmware: int
) -> list[TableItem]:
    return [
        *(_ro(0, 2, number), _ro(2, 1, firmware), _rw(3, 1, 1, 253), _rw(4, 1, baud, 254), _rw(5, 1, 250, 254)),
        *(_rw(6, 2, 0, last), _rw(8, 2, last, last), _rw(11, 1, hot, 99), _rw(12, 1, volts[0], 250, 50)),
        *(_rw(13, 1, volts[1], 250, 50), _rw(14, 2, 1023, 1023), _rw(16, 1, 2, 2), _rw(17, 1, 36), _rw(18, 1, 36)),
        *(_rw(24, 1, 0, 1), _rw(25, 1, 0, 1), _rw(30, 2, 0, last), _rw(32, 2, 0, 2047), _rw(34, 2, 1023, 1023)),
        *(_ro(36, 2), _ro(38, 2), _ro(40, 2), _ro(42, 1), _ro(43, 1), _ro(44, 1), _ro(46, 1), _rw(47, 1, 0, 1)),
    ]


def _mx(number: int, firmware: int) -> list[TableItem]:
    return [
        *_protocol_1(number, baud=34, last=4095, hot=80, volts=(60, 240), firmware=firmware),
        *(_rw(20, 2, 0), _rw(22, 1, 1, 4, 1), _rw(26, 1, 0, 254), _rw(27, 1, 0, 254), _rw(28, 1, 32, 254)),
        *(_rw(48, 2, 0, 1023), _ro(50, 2), _rw(73, 1, 0, 254)),
    ]


_INDIRECT = ((168, 224, 28), (578, 634, 28))  # first address of the targets, of the data, how many
_INDIRECT_XL330 = ((168, 208, 20),)


def _protocol_2(
    number: int,
    *,
    speed: int,
    current: int | None = None,
    volts: tuple[int, int] = (95, 160),
    hot: int = 80,
    position_p: int = 850,
    firmware: int = 45,
    acceleration: bool = False,
    indirect: tuple[tuple[int, int, int], ...] = _INDIRECT,
) -> list[TableItem]:
    """Entries of protocol 2.0; without `current` it measures none, with `acceleration` it has a limit of it.

    Indirect data are bytes that stand elsewhere: `indirect` tells where each stretch keeps its targets and its data.
    """
    targets = [(low + 2 * k, data + k) for low, data, many in indirect for k in range(many)]
    currents = [] if current is None else [_rw(38, 2, current, current), _signed(102, 2, current)]
    return [
        *(_ro(0, 2, number), _ro(2, 4), _ro(6, 1, firmware), _rw(7, 1, 1, 252), _rw(8, 1, 1, 7), _rw(9, 1, 250, 254)),
        *(_rw(10, 1, 0, 5), _rw(11, 1, 3, 16), _rw(12, 1, 255), _rw(13, 1, 2, 2, 1), _signed(20, 4, 1_044_479)),
        *(_rw(24, 4, 10, 1023), _rw(31, 1, hot, 100), _rw(32, 2, volts[1], volts[1], volts[0])),
        *(_rw(34, 2, volts[0], volts[1], volts[0]), _rw(36, 2, 885, 885), _rw(44, 4, speed, 1023), *currents),
        *([_rw(40, 4, 32767, 32767)] if acceleration else []),
        *(_rw(48, 4, 4095, 4095), _rw(52, 4, 0, 4095), _rw(63, 1, 52), _rw(64, 1, 0, 1), _rw(65, 1, 0, 1)),
        *(_rw(68, 1, 2, 2), _ro(69, 1), _ro(70, 1), _rw(76, 2, 1920, 16383), _rw(78, 2, 100, 16383)),
        *(_rw(80, 2, 0, 16383), _rw(82, 2, 0, 16383), _rw(84, 2, position_p, 16383), _rw(88, 2, 0, 16383)),
        *(_rw(90, 2, 0, 16383), _rw(98, 1, 0, 127), _signed(100, 2, 885)),
        *(_signed(104, 4, speed), _rw(108, 4, 0, 32767), _rw(112, 4, 0, 32767), _signed(116, 4, 1_048_575)),
        *(_ro(120, 2), _ro(122, 1), _ro(123, 1), _ro(124, 2), _ro(126, 2), _ro(128, 4), _ro(132, 4), _ro(136, 4)),
        *(_ro(140, 4), _ro(144, 2), _ro(146, 1)),
        *(_rw(address, 2, target, 661, 64) for address, target in targets),
        *(_rw(target, 1, 0) for _, target in targets),
    ]


_AX = [
    *_protocol_1(12, baud=1, last=1023, hot=70, volts=(60, 140), firmware=24),
    *(_rw(26, 1, 1), _rw(27, 1, 1), _rw(28, 1, 32, 254), _rw(29, 1, 32, 254), _rw(48, 2, 32, 1023)),
]
ITEMS: dict[int, list[TableItem]] = {  # by model number
    12: _AX,
    29: _mx(29, 36),
    310: [*_mx(310, 36), _rw(68, 2, 2048, 4095), _rw(70, 1, 0, 1), _rw(71, 2, 0, 2047)],
    30: _protocol_2(30, speed=380, acceleration=True, firmware=42),
    311: _protocol_2(311, speed=435, current=1941, acceleration=True, firmware=42),
    321: _protocol_2(321, speed=360, current=2047, acceleration=True, firmware=42),
    1000: _protocol_2(1000, speed=130, current=648, position_p=800),
    1020: _protocol_2(1020, speed=350, current=1193, position_p=800, acceleration=True),
    1060: _protocol_2(1060, speed=265, volts=(60, 140), hot=72, position_p=640),
    1120: _protocol_2(1120, speed=128, current=2047, position_p=800),
    1200: _protocol_2(1200, speed=445, current=1750, volts=(35, 70), hot=70, position_p=400, indirect=_INDIRECT_XL330),
}

INDIRECT = {  # by model number: where the target of each byte of indirect data stands
    number: {
        data + k: low + 2 * k
        for low, data, many in (_INDIRECT_XL330 if number == 1200 else _INDIRECT)
        for k in range(many)
    }
    for number, items in ITEMS.items()
    if any(item.address == _INDIRECT[0][0] for item in items)
}


@dataclass(slots=True)
class Memory:
    """The bytes of a control table; `ram` is its first address that a restart resets."""

    items: dict[int, TableItem]
    ram: int
    data: bytearray = field(init=False)

    def __post_init__(self) -> None:
        self.data = bytearray(max(item.address + item.size for item in self.items.values()))
        self.reset(0)

    def reset(self, first: int) -> None:
        """Factory values from an address on."""
        for item in self.items.values():
            if item.address >= first:
                self[item.address] = item.value

    def __getitem__(self, address: int) -> int:
        item = self.items[address]
        return int.from_bytes(self.data[address : address + item.size], "little", signed=item.low < 0)

    def __setitem__(self, address: int, value: int) -> None:
        item = self.items[address]
        self.data[address : address + item.size] = (value % (1 << 8 * item.size)).to_bytes(item.size, "little")

    def __contains__(self, address: int) -> bool:
        return address in self.items

    def refuses(self, address: int, data: bytes, *, locked: bool) -> int:
        """Why these bytes cannot be written there; 0 when they can. `locked`: nothing before the RAM can."""
        end = address + len(data)
        if not data or end > len(self.data):
            return ACCESS
        while address < end:
            item = self.items.get(address)
            if item is None or not item.writable or (locked and address < self.ram):
                return ACCESS
            if address + item.size > end:
                return LENGTH
            part = data[len(data) - (end - address) :][: item.size]
            if not item.low <= int.from_bytes(part, "little", signed=item.low < 0) <= item.high:
                return RANGE
            address += item.size
        return 0
