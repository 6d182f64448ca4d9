"""Every example runs, from any folder, and says what it promises."""

import re
import runpy
from pathlib import Path

import pytest

from scanwright.firmware_io.calibration import entropy

EXAMPLES = Path(__file__).parent.parent / "examples"

SAID = {  # script -> what its output must hold
    "01_task_to_angles.py": r"(?P<factor>[\d.]+) times the beams where it matters",
    "02_density_picture.py": r"wrote out/examples/density\.png",
    "03_linkage_as_shape.py": r"linkage: \d+\.\d cm3",
    "04_twins_to_cloud.py": r"[\d,]+ points; columns time_s, joint_rad, ring",
    "05_simulate_and_deskew_by_hand.py": r"at most 0\.\d+ um from the library's",
    "06_write_a_recording.py": r"wrote [\d,]+ points of 86,480 beams",
    "07_calibrate.py": r"x \[deg\]  built  0\.400, found  0\.\d+ \+- 0\.\d+",
    "08_register.py": r"off by (?P<mm>[\d.]+) mm",
    "09_your_own_lidar.py": r"MY-LIDAR: 361 beams, 15 scans a second",
}


def test_none_is_forgotten_and_none_is_long():
    scripts = sorted(EXAMPLES.glob("*.py"))
    assert [script.name for script in scripts] == sorted(SAID)
    assert all(len(script.read_text().splitlines()) <= 100 for script in scripts)


@pytest.mark.parametrize("script", sorted(SAID))
def test_it_runs(script, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(EXAMPLES)
    monkeypatch.setattr(entropy, "_SAMPLE", 1500)  # the pairs of points grow with the square
    runpy.run_path(str(EXAMPLES / script), run_name="__main__")
    said = capsys.readouterr().out
    found = re.search(SAID[script], said)
    assert found, said
    judged = found.groupdict()
    assert float(judged.get("factor", 2)) >= 1
    assert float(judged.get("mm", 0)) < 5
    for row in re.finditer(r"built\s+([-\d.]+), found\s+([-\d.]+) \+- ([\d.]+)", said):
        built, got, sigma = map(float, row.groups())
        assert abs(got - built) < 5 * sigma + 5e-4, said
