"""Scan rate, resolution and field of a configurable SICK lidar."""

from __future__ import annotations

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.lidar.sick.dialogue import ColaDialogue, RefusedError

# error codes of mLMPsetscancfg
_SET_UP = {1: "its scan frequency", 2: "its resolution", 3: "its scan frequency and resolution", 4: "its scan area"}


def set_rate(dialogue: ColaDialogue, lidar: Lidar) -> None:
    """Set rate, resolution and field to those of the catalogue, if the sensor supports that."""
    step = round(3_600_000 / lidar.steps_per_turn)
    first = 900_000 + round((lidar.first_step - lidar.front_step) * 3_600_000 / lidar.steps_per_turn)
    last = 900_000 + round((lidar.last_step - lidar.front_step) * 3_600_000 / lidar.steps_per_turn)
    rate = round(lidar.scan_rate_hz * 100)
    try:
        now = dialogue.ask(dialogue.writer("sRN LMPscancfg"))
    except RefusedError as refused:
        if refused.unknown:
            return
        raise
    rate_now, _, step_now = (dialogue.checked("LMPscancfg", now.number, kind) for kind in ("u32", "u16", "u32"))
    if rate_now == rate and abs(step_now - step) <= 1:
        return
    out = dialogue.writer("sMN mLMPsetscancfg").number("u32", rate).number("u16", 1).number("u32", step)
    reply = dialogue.ask(out.number("i32", first).number("i32", last))
    if code := dialogue.checked("mLMPsetscancfg", reply.number, "u8"):
        raise DeviceError(
            f"{dialogue.line.name}: {lidar.scan_rate_hz:g} Hz in steps of {step / 1e4:g} deg: it rejects "
            f"{_SET_UP.get(code, f'with code {code}')}; is it a {lidar.name}?"
        )
