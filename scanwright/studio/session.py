"""One sitting at the studio: its page is served until nobody has looked at it for some minutes."""

from __future__ import annotations

import logging
from pathlib import Path

from scanwright.design.progress import Progress
from scanwright.design.task.task import LoadedTask
from scanwright.serving.page_server import guarded_server, wait_until_alone
from scanwright.studio.page import Studio

_LOG = logging.getLogger(__name__)
ALONE_S = 300.0  # without a visitor; a browser that restarts returns sooner


def run_studio(loaded: LoadedTask, *, port: int, out: Path, progress: Progress) -> None:
    """Serve the studio of a task, and print its address.

    Task files are saved to the folder that this was started in.

    Args:
        loaded: the task that is opened first.
        port: of 127.0.0.1; 0 is any that is free.
        out: folder that holds the builds.
        progress: progress callback.

    Raises:
        TaskError: the port is taken, or the task has no region.
    """
    with guarded_server(f"Scanwright: {loaded.task.name}", port) as (server, gate):
        progress("reading the task (the first run compiles the numerics: some 5 s)")
        studio = Studio(server, loaded, Path.cwd(), out)
        try:
            print(f"open {gate.address}", flush=True)
            studio.searching.begin()
            print(f"Ctrl-C ends it; without a visitor it ends by itself after {ALONE_S / 60:g} minutes", flush=True)
            wait_until_alone(gate, ALONE_S)
        finally:
            studio.close()
        for why, count in gate.refused.items():
            _LOG.warning("refused %d requests: %s", count, why)
