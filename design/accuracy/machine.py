"""The machine of a run time, in one line."""

from __future__ import annotations

import platform
from pathlib import Path

from scanwright.design.concurrency.processes import cores

CPUINFO = Path("/proc/cpuinfo")


def this_machine() -> str:
    """Return processor, usable cores, system and Python."""
    lines = CPUINFO.read_text().splitlines() if CPUINFO.exists() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    processor = named[0] if named else platform.processor() or "unnamed processor"
    system = f"{platform.system()} {platform.machine()}, Python {platform.python_version()}"
    return f"{processor}, {cores()} cores, {system}"
