"""The Python interface: what a notebook does, and what importing it costs."""

import ast
import shutil
import subprocess
import sys
from importlib.metadata import version
from inspect import isclass, isfunction
from pathlib import Path

import numpy as np
import pytest

import scanwright as sw
from scanwright import api
from scanwright.design import errors as design_errors
from scanwright.design.errors import RecordingError, TaskError

TASK = {
    "name": "ahead",
    "sensor": "URG-04LX",
    "servo": "AX-12A",
    "motion": {"mode": "sweep", "limits_deg": [-90, 90], "period_s": 4.0, "accel_deg_s2": 400.0},
    "angles": {"alpha_rot_deg": 0, "beta_rot_deg": 0, "alpha_laser_deg": 0, "beta_laser_deg": -60},
    "density": {"ball_radius_deg": 3.0, "tolerance": 0.01},
    "weight": [{"shape": "band", "theta_deg": [45, 135]}],
}


def loaded_after(code):
    told = subprocess.run(
        [sys.executable, "-c", f"{code}; import sys; print(*sys.modules)"], capture_output=True, text=True
    )
    assert told.returncode == 0, told.stderr
    return set(told.stdout.split())


def test_importing_scanwright_loads_nothing_heavy():
    assert not loaded_after("import scanwright") & {"numpy", "scipy", "numba", "cadquery", "matplotlib", "pydantic"}


def test_loading_a_task_loads_neither_kernel_nor_compiler_nor_pictures():
    loaded = loaded_after("import scanwright as sw; sw.load_task('ceiling')")
    assert not loaded & {"cadquery", "OCP", "scipy.spatial", "numba", "matplotlib", "trimesh"}


def test_every_public_name_is_documented_and_is_a_function_of_the_api_or_a_type():
    functions = {name for name, value in vars(api).items() if isfunction(value)}
    for name in set(sw.__all__) - {"__version__"}:
        assert getattr(sw, name).__doc__, name
        assert isclass(getattr(sw, name)) is (name not in functions), name
    assert functions <= set(sw.__all__)
    assert sw.__version__ == version("scanwright")


def test_all_that_the_functions_take_and_return_is_public():
    """Names of our own in the annotations of the API; aliases such as `TaskLike` are unions of public types."""
    private = set()
    for path in Path(api.__file__).parent.glob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        ours = {
            alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("scanwright.")
            for alias in node.names
        }
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and node.name in sw.__all__:
                hints = [one.annotation for one in (*node.args.args, *node.args.kwonlyargs)] + [node.returns]
                used = {one.id for hint in hints for one in ast.walk(hint) if isinstance(one, ast.Name)}
                private |= used & ours - set(sw.__all__)
    assert private <= {"AnglesLike", "Progress", "TaskLike", "Trajectory"}, private


def test_every_error_is_public():
    errors = {name for name, value in vars(design_errors).items() if isclass(value) and issubclass(value, Exception)}
    assert errors <= set(sw.__all__)


@pytest.mark.parametrize(
    "command", [["-c", "import scanwright; scanwright.load_task('ceiling')"], ["-m", "scanwright", "catalogue"]]
)
def test_files_named_like_our_folders_do_not_matter(tmp_path, command):
    for name in ("design", "cad", "firmware_io"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('the wrong module was imported')")
    ran = subprocess.run([sys.executable, *command], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr


def test_a_clone_without_symbolic_links_says_so(tmp_path):
    package = Path(sw.__file__).parent
    (tmp_path / "scanwright").mkdir()
    shutil.copy(package / "__init__.py", tmp_path / "scanwright")
    (tmp_path / "scanwright" / "design").write_text("../design")
    ran = subprocess.run([sys.executable, "-c", "import scanwright"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.stderr.splitlines()[-1].startswith("ImportError: scanwright/design is no folder")
    assert set(sw.__all__) <= set(dir(sw))
    with pytest.raises(AttributeError, match="no attribute 'optimize'"):
        _ = sw.optimize


def test_a_notebook_goes_from_a_table_to_arrays_without_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    angles = sw.optimise(TASK).angle_set()
    figure = sw.draw_density(TASK, {"the only setting": (0, 0, 0, -60)})
    recorded = sw.simulate(angles, noise_mm=0.0)
    assert len(figure.axes) == 2  # the map and its bar
    assert recorded.range_m.shape == recorded.bearing_rad.shape == recorded.joint_rad.shape == (40, 682)
    # each beam through the frames by hand: nothing of the furnished room lies outside of its walls
    T = angles.T_world_laser(recorded.joint_rad.ravel())
    beams = np.stack([np.cos(recorded.bearing_rad), np.sin(recorded.bearing_rad)], axis=-1).reshape(-1, 2)
    points = recorded.range_m.ravel()[:, None] * np.einsum("nij,nj->ni", T[:, :3, :2], beams) + T[:, :3, 3]
    seen = np.isfinite(points).all(axis=1)
    assert seen.mean() > 0.5
    low, high = points[seen].min(axis=0), points[seen].max(axis=0)
    assert (low > [-3.202, -2.402, -0.902]).all()
    assert (high < [4.002, 3.202, 1.902]).all()
    assert not list(tmp_path.iterdir())


def test_a_recording_comes_as_arrays(tmp_path):
    from scanwright.firmware_io.recording.recording import recording_writer
    from scanwright.firmware_io.samples import Scan

    start_ns = 1_700_000_000_000_000_000
    with recording_writer(tmp_path / "two.mcap", {}) as writer:
        for k, beams in enumerate((3, 5)):
            writer.joint(start_ns + k * 25_000_000, 0.1 * k)
            writer.scan(
                Scan(
                    stamp_ns=start_ns + k * 25_000_000,
                    angle_min_rad=-0.5,
                    angle_increment_rad=0.25,
                    time_increment_s=1e-3,
                    scan_time_s=0.025,
                    range_min_m=0.1,
                    range_max_m=30.0,
                    range_m=np.arange(1, beams + 1, dtype=np.float32),
                    intensity=np.empty(0, np.float32),
                )
            )
    arrays = sw.open_recording(tmp_path / "two.mcap").arrays()
    np.testing.assert_array_equal(arrays.range_m, [[1, 2, 3, np.nan, np.nan], [1, 2, 3, 4, 5]])
    np.testing.assert_allclose(arrays.bearing_rad[1], [-0.5, -0.25, 0.0, 0.25, 0.5])
    np.testing.assert_array_equal(arrays.time_ns[1] - arrays.time_ns[1, 0], np.arange(5) * 1_000_000)
    assert arrays.intensity.shape == (2, 0)
    np.testing.assert_allclose(arrays.joint_rad[0, :3], [0.0, 0.004, 0.008], atol=1e-9)


def test_wrong_input_is_one_line():
    with pytest.raises(TaskError, match=r"task: sensr: unknown key; did you mean 'sensor'\?"):
        sw.load_task({"name": "x", "sensr": "UTM-30LX"})
    with pytest.raises(TaskError, match="four numbers in degrees"):
        sw.evaluate("uniform", (0, 90, 0))
    with pytest.raises(RecordingError, match=r"'\.docx' is not a format of clouds"):
        sw.read_cloud("cloud.docx")


def test_a_calibration_does_not_overwrite_the_angles_that_it_began_with(tmp_path):
    angles = tmp_path / "angles.json"
    angles.write_text(Path("design/angle_sets/tilting_urg.json").read_text())
    before = angles.read_bytes()
    with pytest.raises(RecordingError, match=r"angles\.json: contains the angles to calibrate"):
        sw.calibrate([tmp_path / "a.mcap"], angles, tmp_path / "." / "angles.json")
    assert angles.read_bytes() == before


def test_clouds_go_out_and_in(tmp_path):
    points = np.arange(12.0).reshape(4, 3)
    assert sw.write_cloud(tmp_path / "cloud.ply", points) == []
    np.testing.assert_array_equal(sw.read_cloud(tmp_path / "cloud.ply").points_m, points)


def test_arguments_of_version_0_1_still_work(monkeypatch):
    """`say=` gets the steps alone; a pole as text is the pole of its numbers."""
    from scanwright.design.evaluation import evaluation
    from scanwright.design.search import optimum

    steps, calls = [], []
    monkeypatch.setattr(optimum, "find_optimum", lambda _, progress: progress("searching", 0.5))
    with pytest.warns(DeprecationWarning, match="say= is now progress="):
        sw.optimise(TASK, say=steps.append)
    assert steps == ["searching"]
    monkeypatch.setattr(evaluation, "evaluate", lambda *arguments: calls.append(arguments))
    with pytest.warns(DeprecationWarning, match=r"pass scanwright\.Pole") as warned:
        sw.evaluate(TASK, (0, 0, 0, -60), pole="20,1000,5")
    assert calls[0][2] == sw.Pole(0.02, 1.0, 5.0)
    assert warned[0].filename == __file__


def test_options_of_assemble_can_be_a_record_or_keywords(monkeypatch):
    from scanwright.firmware_io.assembly import assemble

    given = []
    monkeypatch.setattr(assemble, "assemble_recording", lambda *given_to, **_: given.append(given_to[3]) or 1 / 0)
    for arguments in ((sw.AssembleOptions(voxel_m=0.1), {}), (sw.AssembleOptions(), {"voxel_m": 0.1})):
        with pytest.raises(ZeroDivisionError):
            sw.assemble("r.mcap", "design/angle_sets/tilting_urg.json", "c.ply", arguments[0], **arguments[1])
    assert given == [sw.AssembleOptions(voxel_m=0.1)] * 2
    with pytest.raises(TypeError, match="voxel"):
        sw.assemble("r.mcap", "design/angle_sets/tilting_urg.json", "c.ply", voxel=0.1)
