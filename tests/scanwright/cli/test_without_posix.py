"""Without the modules of POSIX systems, as on Windows, everything that drives no device works.

`build` does so in `tests/scanwright/pipeline/test_build.py`.
"""

import os
import subprocess
import sys

from imports import ROOT

REFUSED = "devices need Linux or macOS; everything that drives no device works here too"
SCRIPT = """
import sys
from importlib import import_module
import without_posix
from pathlib import Path
import numpy as np
import scanwright as sw
from scanwright.firmware_io.calibration import entropy
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.ply import read_ply, write
from scanwright.firmware_io.recording.recording import recording_writer
from scanwright.firmware_io.samples import Scan
from scanwright.cli.app import run as main

def run(*words):
    sys.argv = ["scanwright", *words]
    try:
        main()
        code = 0
    except SystemExit as end:
        code = end.code or 0
    print("ran", words[0], code, flush=True)

Path("ahead.toml").write_text(sys.argv[1], encoding="utf-8")
angles = sw.load_task("ahead.toml").angle_set((0, 0, 0, -60))
seen = sw.simulate(angles, noise_mm=1.0)
with recording_writer(Path("seen.mcap"), {}) as recording:
    messages = [(t, None, p) for t, p in zip(seen.joint_log.time_ns, seen.joint_log.position_rad)]
    messages += [(t, k, None) for k, t in enumerate(seen.time_ns[:, 0])]
    for t, k, p in sorted(messages, key=lambda message: message[0]):
        if k is None:
            recording.joint(10**18 + int(t), float(p))
        else:
            recording.scan(Scan(
                stamp_ns=10**18 + int(t), angle_min_rad=float(seen.bearing_rad[k, 0]),
                angle_increment_rad=float(np.diff(seen.bearing_rad[k, :2])[0]),
                time_increment_s=float(np.diff(seen.time_ns[k, :2])[0]) / 1e9, scan_time_s=0.1, range_min_m=0.1,
                range_max_m=30.0, range_m=seen.range_m[k], intensity=np.empty(0, np.float32)))
Path("angles.json").write_text(angles.to_json(), encoding="utf-8")
run("evaluate", "ahead.toml", "--angles=0,0,0,-60")
run("import", "seen.mcap", "--scan", "/scan", "--angle", "/joint_states", "--angle-unit=rad", "-o", "imported.mcap")
entropy._SAMPLE = 1500  # the pairs of points grow with the square
run("assemble", "imported.mcap", "--angles", "angles.json", "-o", "cloud.ply")
run("calibrate", "imported.mcap", "--angles", "angles.json", "-o", "calibrated.json")
rows = read_ply(Path("cloud.ply"))
moved = np.stack([rows[axis][::2] for axis in "xyz"], axis=1) + np.float32([0.05, 0.0, 0.0])
write(Path("moved.ply"), Cloud(moved))
run("register", "cloud.ply", "moved.ply", "-o", "merged.ply")
run("map", "cloud.ply", "-o", "map.yaml")
run("catalogue")
run("schema")
run("optimise", "ahead.toml", "-q")
run("repair", "seen.mcap", "-o", "whole.mcap")
run("convert", "cloud.ply", "other.pcd")
for module in ("api.parts", "api.tasks", "pipeline.build", "pipeline.comparison", "study.study", "cli.pages"):
    import_module(f"scanwright.{module}")
from scanwright.design.errors import BuildError
from scanwright.pipeline.folder import fresh_folder
with fresh_folder(Path("out/ahead")) as folder:
    (folder / "a.txt").write_text("a", encoding="utf-8")
    try:
        with fresh_folder(Path("out/ahead")):
            print("two builds at once")
    except BuildError as error:
        print("refused:", error)
print("built", sorted(path.name for path in Path("out").rglob("*")))
run("scan", "out/ahead")
run("doctor")
"""


def test_what_drives_no_device_works_and_devices_are_refused_in_one_line(tmp_path, cheapest_task):
    words = [sys.executable, "-c", SCRIPT, cheapest_task]
    environment = os.environ | {"PYTHONPATH": str(ROOT / "tests" / "house")}
    done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    codes = dict(line.split()[1:] for line in done.stdout.splitlines() if line.startswith("ran "))
    assert codes == dict.fromkeys(codes.keys() - {"scan", "doctor"}, "0") | dict.fromkeys(("scan", "doctor"), "2")
    assert "another build of this folder is at work" in done.stdout
    assert "two builds" not in done.stdout and "built ['a.txt', 'ahead']" in done.stdout
    errors = [line for line in done.stderr.splitlines() if line.startswith("error: ")]
    assert errors == [f"error: {REFUSED}"] * 2
    assert len(codes) == 13
