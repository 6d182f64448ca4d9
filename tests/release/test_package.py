"""The wheel holds the packages and nothing else, the sdist the whole checkout, and each makes the same wheel."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / ".ci"))
import package

ROOT = package.ROOT
HELD = {"a/b.py": "1", "x-1.dist-info/METADATA": "2", "x-1.dist-info/licenses/LICENSE": "3"}
PACKAGES = {"b.py": "1"}  # the build names the folder


def test_wheel_and_sdist_hold_what_they_should(tmp_path):
    wheel, sdist = package.build_wheel(ROOT, tmp_path), package.build_sdist(ROOT, tmp_path)
    held, packages = package.contents(wheel), package.package_files(ROOT)
    assert len(packages) > 100
    assert package.faults_of_wheel(held, packages) == []
    assert [name for name in held if {"tests", "__pycache__"} & set(Path(name).parts)] == []
    tree = package.unpacked(sdist, tmp_path)
    assert package.faults_of_sdist(ROOT, tree) == []
    assert (tree / "tests/release/test_package.py").exists()
    assert package.differences(held, package.contents(package.build_wheel(tree, tmp_path / "again"))) == []
    (tree / "scanwright/__init__.py").write_text('__version__ = "9.9.9"\n')
    other = package.contents(package.build_wheel(tree, tmp_path / "other"))
    assert any(line.startswith("scanwright/__init__.py: ") for line in package.differences(held, other))


@pytest.mark.parametrize(
    ("held", "packages", "fault"),
    [
        (HELD | {"tests/test_b.py": "4"}, PACKAGES, "tests/test_b.py: in the wheel, but in no package"),
        (HELD, PACKAGES | {"c.toml": "5"}, "c.toml: not in the wheel"),
        ({"a/b.py": "1"}, PACKAGES, "LICENSE: not in the wheel"),
    ],
)
def test_a_file_too_many_or_too_few_is_named(held, packages, fault):
    assert package.faults_of_wheel(HELD, PACKAGES) == []
    assert package.faults_of_wheel(held, packages) == [fault]


def test_a_command_that_starts_slowly_costs_its_processor_time():
    busy = "import time\nwhile time.process_time() < 0.2: pass"
    assert 0.19 < package.processor_s([sys.executable, "-c", busy]) < 2
