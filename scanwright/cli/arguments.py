"""Arguments and options that several commands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

TaskFile = Annotated[Path, Argument(metavar="TASK", help="Task file, or name of a shipped task.")]
TaskOrBuild = Annotated[Path, Argument(metavar="TASK", help="Task file, name of a shipped task, or build folder.")]
BuildFolder = Annotated[Path, Argument(metavar="BUILD", help="Build folder (contains angles.json).")]
Angles = Annotated[Path, Option(metavar="FILE", help="Angle set: angles.json, or a calibrated one.")]
Out = Annotated[Path, Option(metavar="DIR", help="Parent of the build folder.")]
Lidar = Annotated[str | None, Option(metavar="ADDR", help="Serial port or HOST:PORT [default: detect].")]
ServoPort = Annotated[str | None, Option("--servo", metavar="PORT", help="Serial port [default: detect].")]
ServoId = Annotated[int | None, Option(min=0, max=252, metavar="N", help="Servo id; needed if several share the bus.")]
Intensity = Annotated[bool, Option("--intensity", help="Also record intensities.")]
Rate = Annotated[float, Option(metavar="X", help="Playback speed factor.")]
AllowOrigin = Annotated[
    list[str] | None,
    Option(metavar="ORIGIN", help="Web page that can connect besides Foxglove's own; repeatable."),
]
AsJson = Annotated[bool, Option("--json", help="Print the result as one JSON object.")]
