"""Requests to several Dynamixels: the addressed servos, and the part of each one."""

from __future__ import annotations

from scanwright.firmware_io.emulators.servo.machine import Request

SYNC_READ, BULK_READ, FAST_SYNC_READ, FAST_BULK_READ = 0x82, 0x92, 0x8A, 0x9A
SYNC_WRITE, BULK_WRITE = 0x83, 0x93
READS, FAST = (SYNC_READ, BULK_READ), (FAST_SYNC_READ, FAST_BULK_READ)


def span(parameters: bytes, *, two: bool) -> tuple[int, int]:
    """Return address and length at the start of the parameters; `two`: protocol 2.0, here and below."""
    wide = 2 if two else 1
    return int.from_bytes(parameters[:wide], "little"), int.from_bytes(parameters[wide : 2 * wide], "little")


def ids_in_turn(request: Request, *, two: bool) -> tuple[int, ...] | None:
    """Return the servos that reply in turn, those of sync and bulk reads; None for another request."""
    if request.instruction in (SYNC_READ, FAST_SYNC_READ) and two:
        return tuple(request.parameters[4:])
    if request.instruction in (BULK_READ, FAST_BULK_READ):
        return tuple(request.parameters[::5] if two else request.parameters[2::3])
    return None


def fast_size(request: Request) -> int:
    """Return the bytes that a fast read requests of all servos, with 4 for each."""
    parameters = request.parameters
    if request.instruction == FAST_SYNC_READ:
        return len(parameters[4:]) * (span(parameters, two=True)[1] + 4)
    return sum(span(parameters[k + 1 :], two=True)[1] + 4 for k in range(0, len(parameters), 5))


def span_for(request: Request, servo_id: int, *, two: bool, bulk: bool) -> tuple[int, int] | None:
    """Return address and length that a sync or bulk read requests of one servo, else None; AX have neither."""
    parameters = request.parameters
    if request.instruction in (SYNC_READ, FAST_SYNC_READ):
        return span(parameters, two=two) if two and servo_id in parameters[4:] else None
    if not bulk:
        return None
    if two:
        blocks = (parameters[start : start + 5] for start in range(0, len(parameters), 5))
        mine = next((block[1:] for block in blocks if block[0] == servo_id), None)
    else:
        blocks = (parameters[start : start + 3] for start in range(1, len(parameters), 3))
        mine = next((bytes([block[2], block[0]]) for block in blocks if block[1:2] == bytes([servo_id])), None)
    return None if mine is None else span(mine, two=two)


def write_for(request: Request, servo_id: int, *, two: bool) -> tuple[int, bytes] | None:
    """Return address and data of a sync or bulk write for one servo; None without any."""
    parameters = request.parameters
    if request.instruction == SYNC_WRITE:
        (address, size), rest = span(parameters, two=two), parameters[4 if two else 2 :]
        starts = range(0, len(rest) - size, size + 1)
        return next(((address, rest[k + 1 : k + 1 + size]) for k in starts if rest[k] == servo_id), None)
    while len(parameters) >= 5:
        (address, size), end = span(parameters[1:], two=two), 5 + int.from_bytes(parameters[3:5], "little")
        if parameters[0] == servo_id:
            return address, parameters[5 : 5 + size]
        parameters = parameters[end:]
    return None
