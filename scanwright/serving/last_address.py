"""The port and the token of the last studio, so that links work after a restart."""

from __future__ import annotations

import json
import os
from pathlib import Path


def state_file() -> Path:
    """Return the file, in the user's folder of states (XDG_STATE_HOME)."""
    folder = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state"
    return Path(folder) / "scanwright" / "studio.json"


def saved_address() -> tuple[int, str] | None:
    """Return port and token; None if there are none, or if others could have read or written them."""
    path = state_file()
    try:
        if path.stat().st_mode & 0o077 or path.is_symlink():
            return None
        state = json.loads(path.read_text(encoding="utf-8"))
        port, token = int(state["port"]), str(state["token"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return (port, token) if 0 < port < 65536 and len(token) >= 32 else None


def save_address(port: int, token: str) -> None:
    """Write port and token, readable by this user only; do nothing if the folder cannot be written."""
    path = state_file()
    try:
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        path.unlink(missing_ok=True)
        path.touch(mode=0o600, exist_ok=False)
        path.write_text(json.dumps({"port": port, "token": token}), encoding="utf-8")
    except OSError:
        return
