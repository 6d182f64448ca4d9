"""Packets of Feetech's STS and SMS servos: frame and sum are those of Dynamixel's protocol 1.0.

So each family replies to the other's pings; status byte, registers and signs differ. A damaged request gets no reply.
"""

from __future__ import annotations

from scanwright.firmware_io.servo.bus.packet_format import Meaning
from scanwright.firmware_io.servo.dynamixel.packets import Protocol1


class Sts(Protocol1):
    """Packet format of STS and SMS."""

    protocol = "STS"

    def meaning(self, error: int) -> Meaning:
        """Decode the status byte, which has only faults of the servo."""
        return Meaning(conditions=error)


STS = Sts()
