"""Commands that open a page in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cad.kernel import require_kernel
from scanwright.cli.console import Progress, require_pages
from scanwright.cli.help import Commands

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
    from design.task.task import load_task
    from scanwright.studio.session import run_studio

    run_studio(load_task(task), port=port, out=out, say=Progress())
