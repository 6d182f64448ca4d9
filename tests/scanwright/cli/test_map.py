"""`scanwright map` from a simulated scanner's cloud to the files of a map, and what it refuses."""

import json

import numpy as np
import pytest
from PIL import Image

import scanwright as sw
from scanwright.design.angles import AngleSet
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import read_clouds, write_clouds

ANGLES = {
    "schema": "scanwright/angles/1",
    "task": "rolling",
    "task_sha256": None,
    "source": "design",
    "angles_deg": dict.fromkeys(["alpha_rot", "gamma_rot", "alpha_laser", "gamma_laser"], 0)
    | {"beta_rot": 90, "beta_laser": -90},
    "delta_rotvec_rot_deg": [0, 0],
    "t_rot_laser_mm": [0, 0, 0],
    "t_world_rot_mm": [0, 0, 130],
    "sensor": "URG-04LX",
    "servo": "AX-12A",
    "slip_ring": None,
    "motion": {"mode": "spin", "period_s": 24.0},
    "J": None,
    "J_error": None,
    "covariance": None,
    "versions": {},
}


@pytest.fixture(scope="module")
def shop(tmp_path_factory):
    """A rolling scanner's cloud of the furnished room, and its angle set."""
    folder = tmp_path_factory.mktemp("map")
    (folder / "angles.json").write_text(json.dumps(ANGLES))
    angles: AngleSet = sw.load_angles(folder / "angles.json")
    recorded = sw.simulate(angles, noise_mm=5.0)
    T = angles.T_world_laser(recorded.joint_rad.ravel())
    beams = np.stack([np.cos(recorded.bearing_rad), np.sin(recorded.bearing_rad)], axis=-1).reshape(-1, 2)
    points = recorded.range_m.ravel()[:, None] * np.einsum("nij,nj->ni", T[:, :3, :2], beams) + T[:, :3, 3]
    write_clouds(folder / "room.ply", [Cloud(points[np.isfinite(points).all(axis=1)])])
    write_clouds(folder / "merged.npz", [Cloud(points[:9], {"count": np.ones(9, np.uint32)})])
    write_clouds(folder / "sky.npz", [Cloud(points[np.isfinite(points).all(axis=1) & (points[:, 2] > 0.2)])])
    (folder / "one.tum").write_text("0 1 2 0 0 0 0 1\n")
    return folder


@pytest.fixture
def run(command, shop, monkeypatch):
    monkeypatch.chdir(shop)
    return lambda *words: command("map", *words)


def test_a_cloud_becomes_a_map(run, shop):
    code, told, complaints = run("room.ply", "--angles", "angles.json", "-o", "room.yaml")
    assert (code, complaints) == (0, [])
    lines = told.splitlines()
    assert lines[0] == "floor at z = -0.900 m, obstacles from 0.1 to 1.8 m above it"
    pixels = np.asarray(Image.open(shop / "room.pgm"))
    occupied, free = (int((pixels == grey).sum()) for grey in (0, 254))
    told_cells = f"{occupied:,} occupied ({occupied * 0.05**2:.2f} m2), {free:,} free ({free * 0.05**2:.2f} m2)"
    assert lines[1].startswith("mapped ") and lines[1].endswith(told_cells)
    assert lines[-1] == "wrote room.yaml, room.pgm"
    assert set(np.unique(pixels)) == {0, 205, 254}
    assert 10 < (pixels == 254).sum() * 0.05**2 < 7.2 * 5.6
    assert "free_thresh: 0.196" in (shop / "room.yaml").read_text()
    _, as_json, _ = run("room.ply", "--angles", "angles.json", "-o", "room.yaml", "--json")
    assert json.loads(as_json)["files"] == ["room.yaml", "room.pgm"]


def test_without_a_place_nothing_is_free_and_a_line_says_so(run, shop):
    code, told, _ = run("room.ply", "-o", "blind.yaml")
    assert code == 0
    assert "unknown scanner position of the cloud, so no cell is free" in told
    assert 254 not in np.asarray(Image.open(shop / "blind.pgm"))


def test_who_stood_there_in_one_cloud_only_is_no_obstacle(run, shop):
    (cloud,), _ = read_clouds(shop / "room.ply")
    on_side = np.stack(np.meshgrid(np.arange(-0.2, 0.2, 0.02), np.arange(-0.8, 0.8, 0.02)), axis=2).reshape(-1, 2)
    somebody = np.insert(on_side, 1, 1.2, axis=1).astype(np.float32)
    write_clouds(shop / "with.ply", [Cloud(np.vstack([cloud.points_m, somebody]))])
    words = ("with.ply", "room.ply", "--angles", "angles.json", "-o", "still.yaml")
    _, told, _ = run(*words)
    with_him = np.asarray(Image.open(shop / "still.pgm"))
    code, without, _ = run(*words, "--seen-through-m", "0.1")
    assert code == 0
    assert "left out" not in told
    (line,) = (line for line in without.splitlines() if line.startswith("left out"))
    count = int(line.split()[2].replace(",", ""))
    assert line == f"left out {count:,} points: another cloud was seen through them"
    assert 0.95 * len(somebody) < count < 1.02 * len(somebody)
    gone = with_him.astype(int) - np.asarray(Image.open(shop / "still.pgm"))
    assert np.count_nonzero((gone < 0) & (with_him == 0)) >= 8  # his cells, 0.4 m wide


def origin_m(path):
    (line,) = (line for line in path.read_text().splitlines() if line.startswith("origin"))
    return np.array(json.loads(line.partition(": ")[2]))


def test_poses_move_the_map(run, shop):
    for name, words in {"here": (), "there": ("--poses", "one.tum")}.items():
        code, _, _ = run("room.ply", "--angles", "angles.json", *words, "-o", f"{name}.yaml")
        assert code == 0
    np.testing.assert_allclose(origin_m(shop / "there.yaml") - origin_m(shop / "here.yaml"), [1, 2, 0], atol=0.051)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("room.ply", "-o", "room.png"), "room.png: a map_server reads room.yaml, with a .pgm in the same folder"),
        (("room.ply", "-o", "no/room.yaml"), "the folder no does not exist"),
        (("room.ply", "-o", "m.yaml", "--resolution-m", "0"), "= 0.0: allowed 0.001 to 10"),
        (("room.ply", "-o", "m.yaml", "--resolution-m", "nan"), "= nan: allowed 0.001 to 10"),
        (("room.ply", "-o", "m.yaml", "--from-m", "2"), "= 1.8: allowed 0 < "),
        (("room.ply", "-o", "m.yaml", "--floor-m", "inf"), "= inf: must be finite"),
        (("room.ply", "-o", "m.yaml", "--floor-m", "90"), "no point and no beam between 0.1 and 1.8 m above the floor"),
        (("sky.npz", "-o", "m.yaml"), "which is no floor then: pass its height as --floor-m"),
        (("sky.npz", "-o", "m.yaml", "--angles", "angles.json"), "no point lies below the scanner"),
        (
            ("merged.npz", "-o", "m.yaml", "--angles", "angles.json"),
            "merged from several clouds (column count): pass those clouds",
        ),
        (("room.ply", "room.ply", "-o", "m.yaml", "--poses", "one.tum"), "1 poses for 2 clouds"),
        (("room.ply", "-o", "m.yaml", "--angles", "none.json"), "none.json"),
        (("room.ply", "-o", "m.yaml", "--seen-through-m", "0"), "= 0.0: must be above 0 and finite"),
        (("room.ply", "room.ply", "-o", "m.yaml", "--seen-through-m", "1"), "0 clouds with a known scanner position"),
        (("none.ply", "-o", "m.yaml"), "none.ply"),
    ],
)
def test_what_makes_no_map_is_one_line_and_no_file(run, shop, words, told):
    code, _, complaints = run(*words)
    assert code == 2
    assert len(complaints) == 1
    assert told in complaints[0]
    assert not (shop / "m.yaml").exists()
    assert not (shop / "m.pgm").exists()
