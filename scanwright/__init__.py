"""Scanwright: one task file becomes the angles, the parts and the frame chain of a rotating 2D lidar.

    import scanwright as sw

The names below are those of `scanwright.api`; each is loaded at its first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scanwright.api import (
        assemble,
        build,
        calibrate,
        check,
        compare,
        draw_density,
        evaluate,
        import_bag,
        load_angles,
        load_task,
        make_map,
        make_parts,
        open_lidar,
        open_recording,
        open_servo,
        optimise,
        read_cloud,
        register,
        scan,
        set_up_servo,
        simulate,
        write_cloud,
    )

__version__ = "0.2.0"  # the only place that states it: the build and `--version` read it here

__all__ = [
    "assemble",
    "build",
    "calibrate",
    "check",
    "compare",
    "draw_density",
    "evaluate",
    "import_bag",
    "load_angles",
    "load_task",
    "make_map",
    "make_parts",
    "open_lidar",
    "open_recording",
    "open_servo",
    "optimise",
    "read_cloud",
    "register",
    "scan",
    "set_up_servo",
    "simulate",
    "write_cloud",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module("scanwright.api"), name)
    raise AttributeError(f"module 'scanwright' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
