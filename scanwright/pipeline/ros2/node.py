"""`ros2 run THIS_PACKAGE scanner [OUT] [OPTIONS] [--ros-args ...]`: the node of `scanwright ros2`.

OUT is a build folder, such as one with a calibration; this package's own if not given. OPTIONS are those of
`scanwright ros2`.
"""

from __future__ import annotations

import os
import sys


def command(words: list[str], share: str) -> list[str]:
    """Return the arguments after `python -m scanwright`.

    Args:
        words: as given to this program.
        share: the package's share folder, a scanner like a build folder is.
    """
    mine = words[: words.index("--ros-args")] if "--ros-args" in words else words
    out, options = (mine[0], mine[1:]) if mine and not mine[0].startswith("-") else (share, mine)
    return ["ros2", *options, "--", out, *words[len(mine) :]]


def main() -> None:
    """Replace this process by the node."""
    from ament_index_python.packages import get_package_share_directory

    words = command(sys.argv[1:], get_package_share_directory("THIS_PACKAGE"))
    os.execv(sys.executable, [sys.executable, "-m", "scanwright", *words])
