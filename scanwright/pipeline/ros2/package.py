"""The ament_python package of a scanner: description with `package://` meshes, launch files, layouts for viewers.

It contains all files that `scanwright ros2` reads, so that its share folder can replace the build folder.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from xml.etree import ElementTree
from xml.sax.saxutils import escape

from scanwright.design.angles import load_angles
from scanwright.design.motion import Spin
from scanwright.pipeline.ros2.layouts import foxglove_layout, rviz_layout

FOLDER = "ros2"
_HERE = Path(__file__).parent
_LAUNCH = ("scanner_launch.py", "description_launch.py")
_ROS = (
    "ament_index_python",
    "diagnostic_msgs",
    "launch",
    "launch_ros",
    "rclpy",
    "robot_state_publisher",
    "rviz2",
    "sensor_msgs",
    "std_msgs",
    "tf2_msgs",
)
_PACKAGE = """<?xml version="1.0"?>
<?xml-model href="http://download.ros.org/schema/package_format3.xsd" schematypens="http://www.w3.org/2001/XMLSchema"?>
<package format="3">
  <name>{name}</name>
  <version>1.0.0</version>
  <description>The 3D scanner of the task {task}, made by Scanwright.</description>
  <maintainer email="robot@example.org">the robot's own</maintainer>
  <license>Apache-2.0</license>
{depends}
  <export>
    <build_type>ament_python</build_type>
  </export>
</package>
"""
_SETUP = """from glob import glob

from setuptools import setup

NAME = "{name}"

setup(
    name=NAME,
    version="1.0.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + NAME]),
        ("share/" + NAME, ["package.xml", "scanner.urdf", *glob("*.json"), *glob("*.npz")]),
        ("share/" + NAME + "/meshes", glob("meshes/*")),
        ("share/" + NAME + "/launch", glob("launch/*.py")),
        ("share/" + NAME + "/layouts", glob("layouts/*")),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    description="The 3D scanner of the task {task}.",
    license="Apache-2.0",
    entry_points={{"console_scripts": ["scanner = " + NAME + ".node:main"]}},
)
"""
_CONFIG = """[develop]
script_dir=$base/lib/{name}
[install]
install_scripts=$base/lib/{name}
"""


def package_name(task: str) -> str:
    """Return a package name by REP 144: lower case, digits, single underscores, a letter first."""
    name = re.sub(r"[^a-z0-9]+", "_", f"{task.lower()}_scanner").strip("_")
    return name if name[0].isalpha() else f"task_{name}"


def write_package(build: Path) -> None:
    """Write `ros2/` into a build folder from its angles, URDF, meshes and mask."""
    angles = load_angles(build / "angles.json")
    name, root = package_name(angles.task), build / FOLDER
    for folder in (name, "resource", "meshes", "launch", "layouts"):
        (root / folder).mkdir(parents=True)
    depends = "\n".join(f"  <exec_depend>{name}</exec_depend>" for name in _ROS)
    period_s = angles.motion.period_s if isinstance(angles.motion, Spin) else 0.0
    texts = {
        "package.xml": _PACKAGE.format(name=name, task=escape(angles.task), depends=depends),
        "setup.py": _SETUP.format(name=name, task=angles.task),
        "setup.cfg": _CONFIG.format(name=name),
        f"resource/{name}": "",
        f"{name}/__init__.py": f'"""The 3D scanner of the task {angles.task}."""\n',
        "scanner.urdf": _urdf(build, root, name),
        "layouts/scanner.rviz": rviz_layout(period_s),
        "layouts/foxglove.json": foxglove_layout(period_s),
    }
    for place, text in texts.items():
        (root / place).write_text(text, encoding="utf-8")
    for launch in _LAUNCH:
        _write_script(root / "launch" / launch, name)
    _write_script(root / name / "node.py", name)
    for name_of_file in ("angles.json", "own_body.npz"):
        shutil.copyfile(build / name_of_file, root / name_of_file)


def _write_script(target: Path, name: str) -> None:
    """Write a file of this folder for the package of that name."""
    target.write_text((_HERE / target.name).read_text(encoding="utf-8").replace("THIS_PACKAGE", name), encoding="utf-8")


def _urdf(build: Path, root: Path, name: str) -> str:
    """Return the description with `package://` meshes, and copy the meshes."""
    robot = ElementTree.fromstring((build / "scanner.urdf").read_text(encoding="utf-8"))
    for mesh in robot.iter("mesh"):
        source = build / mesh.get("filename", "")
        shutil.copyfile(source, root / "meshes" / source.name)
        mesh.set("filename", f"package://{name}/meshes/{source.name}")
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(robot, encoding="unicode")}\n'
