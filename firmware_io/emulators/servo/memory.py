"""Control table of an emulator."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

# Errors of a request, numbered as in protocol 2.0; 1.0 has only some.
RANGE, LENGTH, ACCESS = 4, 5, 7


@dataclass(frozen=True, slots=True)
class TableItem:
    """One entry; a writable one accepts counts from `low` to `high`, or only those of `only` if there are any."""

    address: int
    size: int
    value: int
    low: int = 0
    high: int = 0
    writable: bool = False
    only: frozenset[int] = frozenset()


def one_of(address: int, size: int, value: int, only: Collection[int]) -> TableItem:
    """Return a writable entry that accepts certain counts."""
    return TableItem(address, size, value, min(only), max(only), True, frozenset(only))


def rw(address: int, size: int, value: int, high: int | None = None, low: int = 0) -> TableItem:
    """Return a writable entry; the default of `high` is the largest count of its bytes."""
    return TableItem(address, size, value, low, (1 << 8 * size) - 1 if high is None else high, True)


def ro(address: int, size: int, value: int = 0) -> TableItem:
    """Return a read-only entry."""
    return TableItem(address, size, value)


def signed(address: int, size: int, bound: int) -> TableItem:
    """Return a writable entry in two's complement."""
    return TableItem(address, size, 0, -bound, bound, True)


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
        """Restore the factory values from an address on."""
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
        """Return the error of a write of these bytes, 0 without one; `locked`: only the RAM is writable."""
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
            count = int.from_bytes(part, "little", signed=item.low < 0)
            if not item.low <= count <= item.high or (item.only and count not in item.only):
                return RANGE
            address += item.size
        return 0
