"""Finished clouds: other formats hold what the PLY holds, what is left out is counted, and edges go where asked."""

import numpy as np
import pytest

from benchmarks.firmware_io.rooms import FURNISHED, Setup, Truth, simulate, write
from scanwright import api
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import RecordingError
from scanwright.firmware_io.assembly.beam_outcome import between_surfaces
from scanwright.firmware_io.assembly.finish import seen_from
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.poses.trajectory import trajectory_of
from scanwright.firmware_io.samples import Scan, blocks

ANGLES = AngleSet(
    task="finish",
    angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=60, beta_laser=20),
    sensor="any",
    servo="any",
    t_world_rot_mm=(0, 0, 500),
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    setup = Setup(beams=120, sweeps=((90.0, 180.0),), noise_m=0.002)
    return write(tmp_path_factory.mktemp("finish") / "r.mcap", simulate(FURNISHED, setup, Truth()))


@pytest.fixture(scope="module")
def plain(recording, tmp_path_factory):
    path = tmp_path_factory.mktemp("plain") / "c.ply"
    return api.assemble(recording, ANGLES, path), api.read_cloud(path)


def adds_up(summary):
    assert summary.beams == summary.points + sum(summary.left_out.values())
    assert not [path for path in summary.out.parent.iterdir() if path not in summary.clouds]


@pytest.mark.parametrize("suffix", ["npz", "xyz", "pcd", "las", "e57"])
def test_every_format_holds_the_points_of_the_ply(recording, plain, tmp_path, suffix):
    if suffix in ("pcd", "las", "e57"):
        pytest.importorskip({"pcd": "pypcd4", "las": "laspy", "e57": "pye57"}[suffix])
    summary = api.assemble(recording, ANGLES, tmp_path / f"c.{suffix}")
    assert summary.clouds == (tmp_path / f"c.{suffix}",) and summary.points == plain[0].points == summary.rows
    adds_up(summary)
    np.testing.assert_allclose(api.read_cloud(summary.out).points_m, plain[1].points_m, atol=2e-4)


def test_a_cloud_for_each_half_turn_is_finished_under_its_number(recording, tmp_path):
    summary = api.assemble(recording, ANGLES, tmp_path / "c.npz", per="half", voxel_m=0.5)
    assert {path.name for path in summary.clouds} >= {"c_000.npz"}
    assert sum(len(api.read_cloud(path).points_m) for path in summary.clouds) == summary.points == summary.rows
    adds_up(summary)


def test_limits_of_the_range_leave_out_and_count(recording, plain, tmp_path):
    summary = api.assemble(recording, ANGLES, tmp_path / "c.ply", min_range_m=1.5, max_range_m=6.0)
    range_m = np.linalg.norm(plain[1].points_m - [0, 0, 0.5], axis=1)
    kept = (range_m >= 1.5) & (range_m <= 6.0)
    assert summary.points == kept.sum()
    assert summary.left_out["too_near"] == (range_m < 1.5).sum()
    adds_up(summary)
    np.testing.assert_array_equal(api.read_cloud(summary.out).points_m, plain[1].points_m[kept])


def test_voxels_outliers_and_normals_are_those_of_the_points_left(recording, plain, tmp_path):
    summary = api.assemble(recording, ANGLES, tmp_path / "c.ply", voxel_m=0.3, outliers=3.0, normals=True)
    adds_up(summary)
    assert summary.left_out["outlier"] > 0 and summary.left_out["another_point_of_the_voxel"] > 0
    cloud = api.read_cloud(summary.out)
    cells = np.floor(cloud.points_m.astype(float) / 0.3)
    assert len(np.unique(cells, axis=0)) == len(cells) == summary.points
    whole = {tuple(row) for row in plain[1].points_m.tolist()}
    assert all(tuple(row) in whole for row in cloud.points_m.tolist())
    normal = np.stack([cloud.columns[name] for name in ("nx", "ny", "nz")], axis=1)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-5)
    assert (np.sum(normal * ([0, 0, 0.5] - cloud.points_m), axis=1) >= 0).all()
    assert cloud.start_ns == plain[1].start_ns


def a_block(ranges):
    range_m = np.array(ranges, np.float32)
    scan = Scan(
        stamp_ns=0,
        angle_min_rad=0.0,
        angle_increment_rad=-0.004,
        time_increment_s=0.0,
        scan_time_s=0.0,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=range_m,
        intensity=range_m[:0],
    )
    return next(blocks([scan]))


@pytest.mark.parametrize(
    ("ranges", "gone"),
    [
        ([2, 2, 2.9, 4, 4], [2]),  # half of its spot on each
        ([4, 4, 3.1, 2, 2], [2]),
        ([2, 2, 4, 4, 4], []),  # an edge without one
        ([2, 2, 1.2, 2, 2], []),  # a pole
        ([2, 2, np.nan, 4, 4], []),
        ((3 / np.cos(np.radians(60) + 0.004 * np.arange(8))).tolist(), []),  # a slanted wall
    ],
)
def test_a_beam_between_two_surfaces_is_found_and_an_edge_kept(ranges, gone):
    assert np.flatnonzero(between_surfaces(a_block(ranges), 8.0)[0]).tolist() == gone


def test_edges_are_left_out_and_counted(recording, plain, tmp_path):
    summary = api.assemble(recording, ANGLES, tmp_path / "c.ply", edges_deg=20.0, organised=True)
    hanging = summary.left_out["between_surfaces"]
    assert hanging > 0 and summary.points == plain[0].points - hanging
    cloud = api.read_cloud(summary.out)
    assert (len(cloud.points_m), int(cloud.valid.sum())) == (summary.rows, summary.points)


def test_a_moving_scanner_has_seen_each_point_from_where_it_was():
    numbers = [[0, 0, 0, 0, 0, 0, 1], [10, 0, 0, 0, 0, np.sqrt(0.5), np.sqrt(0.5)]]
    poses = trajectory_of([0, 10**10], numbers)
    cloud = Cloud(np.zeros((2, 3)), {"time_s": np.array([0.0, 10.0])}, start_ns=0)
    mount = ANGLES.model_copy(update={"t_world_rot_mm": (1000, 0, 0)})
    np.testing.assert_allclose(seen_from(mount, poses)(cloud), [[1, 0, 0], [10, 1, 0]], atol=1e-9)
    with pytest.raises(RecordingError, match="include time_s in columns"):
        seen_from(mount, poses)(Cloud(np.zeros((2, 3)), start_ns=0))


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"voxel_m": 0.0}, "voxel_m = 0"),
        ({"outliers": -1.0}, "outliers = -1"),
        ({"min_range_m": 3.0, "max_range_m": 2.0}, "min_range_m = 3.0, max_range_m = 2.0"),
        ({"edges_deg": 60.0}, "edges_deg = 60"),
        ({"voxel_m": 0.1, "organised": True}, "which drop beams"),
        ({"min_range_m": 25.0}, "none of the 9600 beams becomes a point"),
    ],
)
def test_what_cannot_be_done_is_said_and_nothing_is_written(recording, tmp_path, options, says):
    with pytest.raises(RecordingError, match=says):
        api.assemble(recording, ANGLES, tmp_path / "c.ply", **options)
    with pytest.raises(RecordingError, match="is not a format of clouds"):
        api.assemble(recording, ANGLES, tmp_path / "c.png")
    assert not list(tmp_path.iterdir())
