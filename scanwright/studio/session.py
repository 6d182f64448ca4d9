"""Serve the studio until some minutes after the last visitor."""

from __future__ import annotations

import logging
from collections.abc import Callable
from pathlib import Path

from scanwright.design.progress import Progress
from scanwright.design.task.task import LoadedTask
from scanwright.serving.page_server import guarded_server, wait_until_alone
from scanwright.studio.page import Studio

_LOG = logging.getLogger(__name__)
ALONE_S = 300.0  # without a visitor; a browser that restarts returns sooner


def run_studio(
    loaded: LoadedTask, *, port: int, out: Path, progress: Progress, announce: Callable[[str], None]
) -> None:
    """Serve the studio of a task; task files are saved to the working folder."""
    with guarded_server(f"Scanwright: {loaded.task.name}", port, recall=True) as (server, gate):
        progress("reading the task (first run: compiling, about 5 s)")
        studio = Studio(server, loaded, Path.cwd(), out)
        try:
            announce(gate.address)
            studio.searching.begin()
            progress(f"press Ctrl-C to end; without a visitor the studio ends after {ALONE_S / 60:g} minutes")
            wait_until_alone(gate, ALONE_S)
        finally:
            studio.close()
        for why, count in gate.refused.items():
            _LOG.warning("refused %d requests: %s", count, why)
