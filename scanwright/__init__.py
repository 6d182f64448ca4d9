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
    from scanwright.api import assemble as assemble
    from scanwright.api import build as build
    from scanwright.api import calibrate as calibrate
    from scanwright.api import check as check
    from scanwright.api import compare as compare
    from scanwright.api import draw_density as draw_density
    from scanwright.api import evaluate as evaluate
    from scanwright.api import import_bag as import_bag
    from scanwright.api import load_angles as load_angles
    from scanwright.api import load_task as load_task
    from scanwright.api import make_map as make_map
    from scanwright.api import make_parts as make_parts
    from scanwright.api import open_lidar as open_lidar
    from scanwright.api import open_recording as open_recording
    from scanwright.api import open_servo as open_servo
    from scanwright.api import optimise as optimise
    from scanwright.api import read_cloud as read_cloud
    from scanwright.api import register as register
    from scanwright.api import scan as scan
    from scanwright.api import set_up_servo as set_up_servo
    from scanwright.api import simulate as simulate
    from scanwright.api import write_cloud as write_cloud
    from scanwright.api.devices import Scanned as Scanned
    from scanwright.cad.assembly.assembly import Assembly as Assembly
    from scanwright.cad.checks.check import Check as Check
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
    from scanwright.design.search.optimum import Optimum as Optimum
    from scanwright.design.task.task import LoadedTask as LoadedTask
    from scanwright.design.task.task import Task as Task
    from scanwright.firmware_io.assembly.assemble import AssembleSummary as AssembleSummary
    from scanwright.firmware_io.calibration.calibrate import Calibration as Calibration
    from scanwright.firmware_io.clouds.cloud import Cloud as Cloud
    from scanwright.firmware_io.lidar.lidar import LidarDriver as LidarDriver
    from scanwright.firmware_io.mapping.map_files import MapSummary as MapSummary
    from scanwright.firmware_io.recording.arrays import RecordingArrays as RecordingArrays
    from scanwright.firmware_io.recording.importer import ImportSummary as ImportSummary
    from scanwright.firmware_io.recording.recording import Recording as Recording
    from scanwright.firmware_io.registration.register_files import RegisteredFiles as RegisteredFiles
    from scanwright.firmware_io.servo.fitness import ServoSetupError as ServoSetupError
    from scanwright.firmware_io.servo.servo import ServoDriver as ServoDriver
    from scanwright.pipeline.build import Build as Build

_TYPES = {
    "Scanned": "scanwright.api.devices",
    "Assembly": "scanwright.cad.assembly.assembly",
    "Check": "scanwright.cad.checks.check",
    "AngleSet": "scanwright.design.angles",
    "BuildError": "scanwright.design.errors",
    "DeviceError": "scanwright.design.errors",
    "DeviceFaultError": "scanwright.design.errors",
    "DeviceTimeoutError": "scanwright.design.errors",
    "InstallError": "scanwright.design.errors",
    "MissingFileError": "scanwright.design.errors",
    "NumericalError": "scanwright.design.errors",
    "ProtocolError": "scanwright.design.errors",
    "RecordingError": "scanwright.design.errors",
    "ScanwrightError": "scanwright.design.errors",
    "SceneError": "scanwright.design.errors",
    "TaskError": "scanwright.design.errors",
    "UnsafeError": "scanwright.design.errors",
    "ComparisonRow": "scanwright.design.evaluation.comparison",
    "Evaluation": "scanwright.design.evaluation.evaluation",
    "Optimum": "scanwright.design.search.optimum",
    "LoadedTask": "scanwright.design.task.task",
    "Task": "scanwright.design.task.task",
    "AssembleSummary": "scanwright.firmware_io.assembly.assemble",
    "Calibration": "scanwright.firmware_io.calibration.calibrate",
    "Cloud": "scanwright.firmware_io.clouds.cloud",
    "LidarDriver": "scanwright.firmware_io.lidar.lidar",
    "MapSummary": "scanwright.firmware_io.mapping.map_files",
    "RecordingArrays": "scanwright.firmware_io.recording.arrays",
    "ImportSummary": "scanwright.firmware_io.recording.importer",
    "Recording": "scanwright.firmware_io.recording.recording",
    "RegisteredFiles": "scanwright.firmware_io.registration.register_files",
    "ServoSetupError": "scanwright.firmware_io.servo.fitness",
    "ServoDriver": "scanwright.firmware_io.servo.servo",
    "Build": "scanwright.pipeline.build",
}
"""The module of each public type."""

__all__ = [
    "AngleSet",
    "AssembleSummary",
    "Assembly",
    "Build",
    "BuildError",
    "Calibration",
    "Check",
    "Cloud",
    "ComparisonRow",
    "DeviceError",
    "DeviceFaultError",
    "DeviceTimeoutError",
    "Evaluation",
    "ImportSummary",
    "InstallError",
    "LidarDriver",
    "LoadedTask",
    "MapSummary",
    "MissingFileError",
    "NumericalError",
    "Optimum",
    "ProtocolError",
    "Recording",
    "RecordingArrays",
    "RecordingError",
    "RegisteredFiles",
    "Scanned",
    "ScanwrightError",
    "SceneError",
    "ServoDriver",
    "ServoSetupError",
    "Task",
    "TaskError",
    "UnsafeError",
    "__version__",
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

if not Path(__file__).with_name("design").is_dir():
    raise ImportError("scanwright/design is no folder: clone with symbolic links (git clone -c core.symlinks=true)")


def __getattr__(name: str) -> Any:
    if name in __all__:
        return getattr(import_module(_TYPES.get(name, "scanwright.api")), name)
    raise AttributeError(f"module 'scanwright' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
