"""Scanwright: one task file becomes the angles, the parts and the frame chain of a rotating 2D lidar.

    import scanwright as sw

The public names: the functions of `scanwright.api`, and the types that they take, return and raise. Each is loaded when
it is first used. Everything else is internal.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"

if TYPE_CHECKING:
    from scanwright.api import *  # noqa: F403, the names of `_FUNCTIONS`
    from scanwright.api.devices import Scanned as Scanned
    from scanwright.cad.assembly.assembly import Assembly as Assembly
    from scanwright.design.angles import AngleSet as AngleSet
    from scanwright.design.errors import BuildError as BuildError
    from scanwright.design.errors import DeviceError as DeviceError
    from scanwright.design.errors import DeviceFaultError as DeviceFaultError
    from scanwright.design.errors import DeviceTimeoutError as DeviceTimeoutError
    from scanwright.design.errors import InstallError as InstallError
    from scanwright.design.errors import MissingFileError as MissingFileError
    from scanwright.design.errors import NumericalError as NumericalError
    from scanwright.design.errors import ProtocolError as ProtocolError
    from scanwright.design.errors import RecordingError as RecordingError
    from scanwright.design.errors import ScanwrightError as ScanwrightError
    from scanwright.design.errors import SceneError as SceneError
    from scanwright.design.errors import TaskError as TaskError
    from scanwright.design.errors import UnsafeError as UnsafeError
    from scanwright.design.evaluation.comparison import ComparisonRow as ComparisonRow
    from scanwright.design.evaluation.evaluation import Evaluation as Evaluation
    from scanwright.design.evaluation.evaluation import Lever as Lever
    from scanwright.design.evaluation.poles import Pole as Pole
    from scanwright.design.findings import Finding as Finding
    from scanwright.design.search.optimum import Optimum as Optimum
    from scanwright.design.task.task import LoadedTask as LoadedTask
    from scanwright.design.task.task import Task as Task
    from scanwright.firmware_io.assembly.assemble import AssembleSummary as AssembleSummary
    from scanwright.firmware_io.assembly.options import AssembleOptions as AssembleOptions
    from scanwright.firmware_io.calibration.calibrate import Calibration as Calibration
    from scanwright.firmware_io.clouds.cloud import Cloud as Cloud
    from scanwright.firmware_io.lidar.lidar import LidarDriver as LidarDriver
    from scanwright.firmware_io.mapping.map_files import MapSummary as MapSummary
    from scanwright.firmware_io.recording.arrays import RecordingArrays as RecordingArrays
    from scanwright.firmware_io.recording.import_checks.corrections import Corrections as Corrections
    from scanwright.firmware_io.recording.importer import ImportSummary as ImportSummary
    from scanwright.firmware_io.recording.recording import Recording as Recording
    from scanwright.firmware_io.registration.register_files import RegisteredFiles as RegisteredFiles
    from scanwright.firmware_io.servo.fitness import ServoSetupError as ServoSetupError
    from scanwright.firmware_io.servo.servo import ServoDriver as ServoDriver
    from scanwright.pipeline.build import Build as Build

_MODULES = {
    "scanwright.api.devices": "Scanned",
    "scanwright.cad.assembly.assembly": "Assembly",
    "scanwright.design.angles": "AngleSet",
    "scanwright.design.errors": (
        "BuildError DeviceError DeviceFaultError DeviceTimeoutError InstallError MissingFileError "
        "NumericalError ProtocolError RecordingError ScanwrightError SceneError TaskError UnsafeError"
    ),
    "scanwright.design.evaluation.comparison": "ComparisonRow",
    "scanwright.design.evaluation.evaluation": "Evaluation Lever",
    "scanwright.design.evaluation.poles": "Pole",
    "scanwright.design.findings": "Finding",
    "scanwright.design.search.optimum": "Optimum",
    "scanwright.design.task.task": "LoadedTask Task",
    "scanwright.firmware_io.assembly.assemble": "AssembleSummary",
    "scanwright.firmware_io.assembly.options": "AssembleOptions",
    "scanwright.firmware_io.recording.import_checks.corrections": "Corrections",
    "scanwright.firmware_io.calibration.calibrate": "Calibration",
    "scanwright.firmware_io.clouds.cloud": "Cloud",
    "scanwright.firmware_io.lidar.lidar": "LidarDriver",
    "scanwright.firmware_io.mapping.map_files": "MapSummary",
    "scanwright.firmware_io.recording.arrays": "RecordingArrays",
    "scanwright.firmware_io.recording.importer": "ImportSummary",
    "scanwright.firmware_io.recording.recording": "Recording",
    "scanwright.firmware_io.registration.register_files": "RegisteredFiles",
    "scanwright.firmware_io.servo.fitness": "ServoSetupError",
    "scanwright.firmware_io.servo.servo": "ServoDriver",
    "scanwright.pipeline.build": "Build",
}
"""Module -> public types in it."""
_TYPES = {name: module for module, names in _MODULES.items() for name in names.split()}
_FUNCTIONS = (
    "assemble build calibrate check compare draw_density evaluate import_bag load_angles load_task make_map "
    "make_parts open_lidar open_recording open_servo optimise read_cloud register scan set_up_servo simulate "
    "write_cloud"
)
__all__ = sorted([*_TYPES, *_FUNCTIONS.split(), "__version__"])

if not Path(__file__).with_name("design").is_dir():
    raise ImportError("scanwright/design is no folder: clone with symbolic links (git clone -c core.symlinks=true)")


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module(_TYPES.get(name, "scanwright.api")), name)
    raise AttributeError(f"module 'scanwright' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
