"""Control tables of the emulators with the factory values of the e-manual."""

from __future__ import annotations

from scanwright.firmware_io.emulators.servo.memory import TableItem, one_of, ro, rw, signed


def _protocol_1(
    number: int, *, baud: int, last: int, hot: int, volts: tuple[int, int], firmware: int
) -> list[TableItem]:
    return [
        *(ro(0, 2, number), ro(2, 1, firmware), rw(3, 1, 1, 253), rw(4, 1, baud, 254), rw(5, 1, 250, 254)),
        *(rw(6, 2, 0, last), rw(8, 2, last, last), rw(11, 1, hot, 99), rw(12, 1, volts[0], 250, 50)),
        *(rw(13, 1, volts[1], 250, 50), rw(14, 2, 1023, 1023), rw(16, 1, 2, 2), rw(17, 1, 36), rw(18, 1, 36)),
        *(rw(24, 1, 0, 1), rw(25, 1, 0, 1), rw(30, 2, 0, last), rw(32, 2, 0, 2047), rw(34, 2, 1023, 1023)),
        *(ro(36, 2), ro(38, 2), ro(40, 2), ro(42, 1), ro(43, 1), ro(44, 1), ro(46, 1), rw(47, 1, 0, 1)),
    ]


def _mx(number: int, firmware: int) -> list[TableItem]:
    return [
        *_protocol_1(number, baud=34, last=4095, hot=80, volts=(60, 240), firmware=firmware),
        *(rw(20, 2, 0), rw(22, 1, 1, 4, 1), rw(26, 1, 0, 254), rw(27, 1, 0, 254), rw(28, 1, 32, 254)),
        *(rw(48, 2, 0, 1023), ro(50, 2), rw(73, 1, 0, 254)),
    ]


_INDIRECT = ((168, 224, 28), (578, 634, 28))  # first address of the targets, of the data, and their number
_INDIRECT_330 = ((168, 208, 20),)
_330 = (1200, 1220, 1240)


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
    """Return the entries of protocol 2.0.

    `current`: its limit, if it is measured; `acceleration`: whether there is a limit of it; `indirect`: first address
    of targets, of data, and number of each block of indirect data.
    """
    modes = (1, 3, 4, 16) if current is None else (0, 1, 3, 4, 5, 16)
    targets = [(low + 2 * k, data + k) for low, data, many in indirect for k in range(many)]
    currents = [] if current is None else [rw(38, 2, current, current), signed(102, 2, current)]
    return [
        *(ro(0, 2, number), ro(2, 4), ro(6, 1, firmware), rw(7, 1, 1, 252), rw(8, 1, 1, 7), rw(9, 1, 250, 254)),
        *(rw(10, 1, 0, 5), one_of(11, 1, 3, modes), rw(12, 1, 255), rw(13, 1, 2, 2, 1), signed(20, 4, 1_044_479)),
        *(rw(24, 4, 10, 1023), rw(31, 1, hot, 100), rw(32, 2, volts[1], volts[1], volts[0])),
        *(rw(34, 2, volts[0], volts[1], volts[0]), rw(36, 2, 885, 885), rw(44, 4, speed, 1023), *currents),
        *([rw(40, 4, 32767, 32767)] if acceleration else []),
        *(rw(48, 4, 4095, 4095), rw(52, 4, 0, 4095), rw(63, 1, 52), rw(64, 1, 0, 1), rw(65, 1, 0, 1)),
        *(rw(68, 1, 2, 2), ro(69, 1), ro(70, 1), rw(76, 2, 1920, 16383), rw(78, 2, 100, 16383)),
        *(rw(80, 2, 0, 16383), rw(82, 2, 0, 16383), rw(84, 2, position_p, 16383), rw(88, 2, 0, 16383)),
        *(rw(90, 2, 0, 16383), rw(98, 1, 0, 127), signed(100, 2, 885)),
        *(signed(104, 4, speed), rw(108, 4, 0, 32767), rw(112, 4, 0, 32767), signed(116, 4, 1_048_575)),
        *(ro(120, 2), ro(122, 1), ro(123, 1), ro(124, 2), ro(126, 2), ro(128, 4), ro(132, 4), ro(136, 4)),
        *(ro(140, 4), ro(144, 2), ro(146, 1)),
        *(rw(address, 2, target, 661, 64) for address, target in targets),
        *(rw(target, 1, 0) for _, target in targets),
    ]


_AX = [
    *_protocol_1(12, baud=1, last=1023, hot=70, volts=(60, 140), firmware=24),
    *(rw(26, 1, 1), rw(27, 1, 1), rw(28, 1, 32, 254), rw(29, 1, 32, 254), rw(48, 2, 32, 1023)),
]
_CURRENT = (rw(68, 2, 2048, 4095), rw(70, 1, 0, 1), rw(71, 2, 0, 2047))
ITEMS: dict[int, list[TableItem]] = {  # by model number
    12: _AX,
    29: _mx(29, 36),
    310: [*_mx(310, 36), *_CURRENT],
    320: [*_mx(320, 36), *_CURRENT, rw(10, 1, 0, 3)],
    30: _protocol_2(30, speed=380, acceleration=True, firmware=42),
    311: _protocol_2(311, speed=435, current=1941, acceleration=True, firmware=42),
    321: _protocol_2(321, speed=360, current=2047, acceleration=True, firmware=42),
    1000: _protocol_2(1000, speed=130, current=648, position_p=800),
    1020: _protocol_2(1020, speed=350, current=1193, position_p=800, acceleration=True),
    1060: _protocol_2(1060, speed=265, volts=(60, 140), hot=72, position_p=640),
    1120: _protocol_2(1120, speed=128, current=2047, position_p=800),
    1200: _protocol_2(1200, speed=445, current=1750, volts=(35, 70), hot=70, position_p=400, indirect=_INDIRECT_330),
    1220: _protocol_2(1220, speed=320, current=910, volts=(55, 140), hot=70, position_p=900, indirect=_INDIRECT_330),
    1240: _protocol_2(1240, speed=350, current=2352, volts=(35, 70), hot=70, position_p=1100, indirect=_INDIRECT_330),
}

INDIRECT = {  # by model number: address of the target of each byte of indirect data
    number: {
        data + k: low + 2 * k
        for low, data, many in (_INDIRECT_330 if number in _330 else _INDIRECT)
        for k in range(many)
    }
    for number, items in ITEMS.items()
    if any(item.address == _INDIRECT[0][0] for item in items)
}
