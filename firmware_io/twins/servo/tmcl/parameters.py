"""Parameters of the twin of a TMCM-1140: what each one may be and is from the factory.

Numbers are those of the maker's client, bounds and factory values assumed where no manual was at hand. Addresses are
those of `firmware_io.servo.tmcl.packets`: global parameters from 1000 on, user variables from 2000.
"""

from __future__ import annotations

_MOST = 2**31 - 1
_LEAST = -(2**31)

GLOBAL, USER = 1000, 2000
BAUDS = (9600, 14_400, 19_200, 28_800, 38_400, 57_600, 76_800, 115_200, 230_400, 250_000, 500_000, 1_000_000)

# Number: factory value, least, most.
AXIS_SETTINGS: dict[int, tuple[int, int, int]] = {
    **{0: (0, _LEAST, _MOST), 1: (0, _LEAST, _MOST), 2: (0, -2047, 2047), 4: (1000, 0, 2047), 5: (500, 0, 2047)},
    **{6: (128, 0, 255), 7: (8, 0, 255), 12: (1, 0, 1), 13: (1, 0, 1), 130: (1, 0, 2047), 138: (0, 0, 2)},
    **{140: (8, 0, 8), 141: (0, 0, 4095), 149: (0, 0, 1), 150: (0, 0, 1), 153: (7, 0, 13), 154: (5, 0, 13)},
    **{160: (0, 0, 1), 161: (0, 0, 1), 162: (2, 0, 3), 163: (0, 0, 1), 164: (0, 0, 1), 165: (3, 0, 15)},
    **{166: (4, 0, 8), 167: (2, 0, 15), 168: (0, 0, 1), 169: (0, 0, 3), 170: (0, 0, 15), 171: (0, 0, 3)},
    **{172: (0, 0, 15), 173: (0, 0, 1), 174: (0, -64, 63), 175: (3, 0, 3), 176: (3, 0, 3), 177: (0, 0, 1)},
    **{178: (0, 0, 3), 179: (0, 0, 1), 181: (0, 0, 2047), 182: (0, 0, 2047), 183: (0, 0, 255), 184: (0, 0, 1)},
    **{193: (1, 1, 8), 194: (0, 0, 2047), 195: (0, 0, 2047), 200: (0, 0, 255), 204: (0, 0, 65535)},
    **{209: (0, _LEAST, _MOST), 210: (25_600, 0, _MOST), 212: (0, 0, _MOST), 214: (200, 1, 65535)},
    **{216: (0, _LEAST, _MOST), 217: (25_600, 0, _MOST), 218: (0, 0, _MOST), 254: (0, 0, 5)},
}
AXIS_READINGS = (3, 8, 9, 10, 11, 135, 180, 196, 197, 206, 207, 208, 215)
GLOBAL_SETTINGS: dict[int, tuple[int, int, int]] = {
    **{65: (0, 0, 11), 66: (1, 1, 255), 67: (0, 0, 255), 68: (0, 0, 65535), 69: (8, 0, 8), 70: (2, 0, 2047)},
    **{71: (1, 0, 2047), 75: (0, 0, 255), 76: (2, 0, 255), 77: (0, 0, 1), 79: (0, 0, 3)},
    **{81: (0, 0, 3), 82: (0, 0, 65535), 83: (0, 0, 2047), 84: (0, 0, 1), 85: (0, 0, 1), 87: (0, 0, 255)},
    **{90: (0, 0, 1), 132: (0, _LEAST, _MOST), 255: (0, 0, 1)},
}
USER_VARIABLES, KEPT_VARIABLES = range(256), range(56)
RUNNING = (0, 1, 2, 209)  # of the axis: what it does, and not how it is set


def from_the_factory() -> dict[int, int]:
    """Every parameter as it comes, by its address."""
    axis = {number: factory for number, (factory, _, _) in AXIS_SETTINGS.items()}
    general = {GLOBAL + number: factory for number, (factory, _, _) in GLOBAL_SETTINGS.items()}
    return axis | general | dict.fromkeys((USER + number for number in USER_VARIABLES), 0)
