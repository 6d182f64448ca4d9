"""Commands that open a page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scanwright.cad.kernel import require_kernel
from scanwright.cli.console import AllowOrigin, ConsoleProgress, require_pages
from scanwright.cli.help import Commands
from scanwright.design.errors import require

app = Commands("Pages")


@app.command()
def studio(
    task: Annotated[Path, typer.Argument(metavar="[TASK]", help="Task file, or the name of a shipped task.")] = Path(
        "ground_ahead"
    ),
    port: Annotated[int, typer.Option(help="Port on this computer; 0 is any that is free.")] = 0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder that holds one build folder per task.")] = Path(
        "out"
    ),
) -> None:
    """Drag the angles and paint what matters in a page of your browser, and see what it comes to."""
    require_pages("studio")

    require_kernel("studio")
    from scanwright.design.task.task import load_task
    from scanwright.studio.session import run_studio

    run_studio(load_task(task), port=port, out=out, progress=ConsoleProgress())


@app.command()
def view(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="MCAP recording of the scanner.")],
    angles: Annotated[Path, typer.Option(metavar="angles.json", help="Angle set of the scanner.")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on this computer; 0 is any that is free.")] = 8765,
    rate: Annotated[float, typer.Option(help="How many times as fast as it was recorded.")] = 1.0,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE.mcap", help="Write what would be shown into a file, and stop."),
    ] = None,
    allow_origin: AllowOrigin = None,
) -> None:
    """Show a recording in Foxglove: its scans, and the points, frames and scanner that they make."""
    require("foxglove", "view needs a websocket server", "websockets")
    from scanwright.live.foxglove_view import view_recording, write_for_foxglove
    from scanwright.serving.handshake import as_origins

    if out is not None:
        print(f"wrote {write_for_foxglove(recording, angles, out):,} scans with their points to {out}")
        return
    try:
        view_recording(
            recording, angles, ConsoleProgress(), port=port, rate=rate, allow_origins=as_origins(allow_origin)
        )
    except KeyboardInterrupt:
        raise typer.Exit(0) from None
