"""Set rate, resolution and field of a SICK lidar that has a choice to those of the catalogue."""

from __future__ import annotations

from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.errors import DeviceError
from scanwright.firmware_io.lidar.sick.dialogue import ColaDialogue, RefusedError

# answers of mLMPsetscancfg
_SET_UP = {1: "its scan frequency", 2: "its resolution", 3: "its scan frequency and resolution", 4: "its scan area"}


def set_rate(dialogue: ColaDialogue, lidar: Lidar) -> None:
    """Set what is not as the catalogue says; a sensor without a choice is left as it is."""
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
    answer = dialogue.ask(out.number("i32", first).number("i32", last))
    code = dialogue.checked("mLMPsetscancfg", answer.number, "u8")
    if code:
        raise DeviceError(
            f"{dialogue.line.name}: {lidar.scan_rate_hz:g} Hz in steps of {step / 1e4:g} deg: it rejects "
            f"{_SET_UP.get(code, f'with code {code}')}; is it a {lidar.name}?"
        )
