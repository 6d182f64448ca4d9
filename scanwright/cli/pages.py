"""Commands that open a page in the browser."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer
from typer import Argument, Option

from scanwright.cad.kernel import require_kernel
from scanwright.cli.arguments import AllowOrigin, Angles, AsJson, Out, Rate
from scanwright.cli.console import ConsoleProgress, require_pages, show_result
from scanwright.cli.help import Commands
from scanwright.cli.results.of_commands import OpenedPage
from scanwright.design.errors import require

app = Commands("Pages")


def _announce(as_json: bool) -> Callable[[str], None]:
    """Return a function that prints the address of a page."""

    def announce(address: str) -> None:
        show_result(lambda: [f"open {address}"], OpenedPage(address=address), as_json)

    return announce


@app.command(example="studio ground_ahead")
def studio(
    task: Annotated[Path, Argument(metavar="TASK", help="Task file, or name of a shipped task.")] = Path(
        "ground_ahead"
    ),
    port: Annotated[int, Option(metavar="N", help="Port; 0 chooses a free one.")] = 0,
    out: Out = Path("out"),
    as_json: AsJson = False,
) -> None:
    """Explore mounting angles in the browser."""
    require_pages("studio")

    require_kernel("studio")
    from scanwright.design.task.task import load_task
    from scanwright.studio.page import run_studio

    run_studio(load_task(task), port=port, out=out, progress=ConsoleProgress(), announce=_announce(as_json))


@app.command(example="view rec.mcap --angles out/ground_ahead/angles.json")
def view(
    recording: Annotated[Path, Argument(metavar="RECORDING", help="Recording of the scanner.")],
    angles: Angles,
    port: Annotated[int, Option(min=0, max=65535, metavar="N", help="Port; 0 chooses a free one.")] = 8765,
    rate: Rate = 1.0,
    out: Annotated[
        Path | None, Option("--out", "-o", metavar="FILE.mcap", help="Write a file for Foxglove and exit.")
    ] = None,
    allow_origin: AllowOrigin = None,
    as_json: AsJson = False,
) -> None:
    """Show a recording in Foxglove."""
    require("foxglove", "view needs a websocket server", "websockets")
    from scanwright.live.foxglove_view import view_recording, write_for_foxglove
    from scanwright.serving.handshake import as_origins

    if out is not None:
        result = OpenedPage(file=out, scans=write_for_foxglove(recording, angles, out))
        show_result(lambda: [f"wrote {result.scans:,} scans with their points to {out}"], result, as_json)
        return
    try:
        view_recording(
            recording,
            angles,
            ConsoleProgress(),
            port=port,
            rate=rate,
            allow_origins=as_origins(allow_origin),
            announce=_announce(as_json),
        )
    except KeyboardInterrupt:
        raise typer.Exit(0) from None
