"""The machine of a run time, in one line."""

from __future__ import annotations

import platform
from pathlib import Path

from scanwright.design.concurrency.processes import cores

CPUINFO = Path("/proc/cpuinfo")


def this_machine() -> str:
    """Return processor, usable cores, system and Python."""
    system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return f"{_processor()}, {cores()} cores, {system}"


def _processor() -> str:
    lines = CPUINFO.read_text().splitlines() if CPUINFO.exists() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or "unnamed processor"
