"""The adjustment of flat pieces: its derivatives, its bias, what it states, and what it needs to be told."""

import json
from itertools import product

import numpy as np
import pytest
from scipy.stats import chi2

from benchmarks.firmware_io.registration import motion, room, scan, shell
from benchmarks.firmware_io.registration_errors import SIGMAS, faulty_scan, one_pair, two_views
from scanwright.design import frames
from scanwright.design.angles import Angles, AngleSet
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import write_clouds
from scanwright.firmware_io.registration.pairwise import _sandwich, align
from scanwright.firmware_io.registration.sensor_view import make_view
from scanwright.firmware_io.registration.surfels.adjust import adjust
from scanwright.firmware_io.registration.surfels.cells import find_cells

LINES, BEAMS = 60, 181


def scanner(sigmas=SIGMAS):
    return AngleSet(
        task="t",
        source="calibration",
        angles_deg=Angles(alpha_rot=0, beta_rot=0, alpha_laser=np.degrees(1.08), beta_laser=np.degrees(1.0)),
        sensor="UTM-30LX",
        servo="MX-64R",
        covariance=tuple(map(tuple, np.diag(np.square(sigmas)).tolist())),
    )


def adjusted(seed, noise_m, *, off):
    rng = np.random.default_rng(seed)
    truth, (a, b) = two_views(rng, LINES, noise_m, off=off, beams=BEAMS)
    start = truth @ frames.rigid(frames.rotvec_to_matrix(rng.normal(0, 5e-4, 3)), rng.normal(0, 5e-3, 3))
    return truth, adjust(a.beams, b.beams, start, a.spacing_m)


@pytest.mark.parametrize(("noise_m", "off"), list(product((0.005, 0.03), (False, True))))
def test_errors_are_as_large_as_stated(noise_m, off):
    """Small scans of four rooms; `benchmarks.firmware_io.registration_errors` has the long table."""
    squared = []
    for seed in range(4):
        truth, found = adjusted(seed, noise_m, off=off)
        error = motion(truth, found[0])
        squared.append(error @ np.linalg.solve(found[1], error))
    low, high = chi2.ppf([0.001, 0.999], 6 * 4) / 4
    assert low < np.mean(squared) < high


def test_the_whole_way_from_a_start_is_as_honest():
    squared, error_mm, sigma_mm = one_pair(4, 80, 0.03, off=True)
    assert squared < 25
    assert error_mm < 2
    assert 0.2 < sigma_mm < 2


def test_a_wall_that_lies_in_a_face_of_the_voxels_does_not_pull():
    """The cube behind it catches the tail of the noise: taken for a surface, it moved poses by 2 mm at 30 mm noise."""
    hall = shell(5.0, 4.0, 3.0)
    a_pose = frames.rigid(np.eye(3), [0.0, 0.0, 1.0])
    truth = frames.rigid(frames.Rz(0.1), [0.5, 0.3, 0.1])
    off = []
    for seed in range(4):
        clouds = (scan(hall, T, 180, 541, 2 * seed + k, 0.03) for k, T in enumerate((a_pose, a_pose @ truth)))
        a, b = (make_view(name, points, 0.1) for name, points in zip("ab", clouds, strict=True))
        off.append(motion(truth, align(a, b, truth).T_a_b))
    # A mean of four pairs: 0.2 mm is noise
    assert np.abs(np.mean(off, axis=0)[3:]).max() < 0.4e-3


def test_the_angle_set_tells_what_the_pair_alone_cannot_know():
    """A wrong calibration moves the pose by many stated sigmas, unless its covariance is given."""
    rng = np.random.default_rng(3)
    boxes = room()
    poses = [frames.rigid(frames.Rz(k * 0.4), [0.4 * k, 0.2 * k, 1.0]) for k in range(2)]
    wrong = np.array([*np.radians([0.15, -0.15]), 0.0, 0.0])
    clouds = [faulty_scan(rng, boxes, T, 240, 361, 0.003, wrong) for T in poses]
    start = np.linalg.inv(poses[0]) @ poses[1]
    exact = adjust(*(make_view("", points, 0.1).beams for points, _ in clouds), start, 0.1)
    angles = scanner(np.array([*np.radians([0.15, 0.15]), 1e-4, 1e-4]))
    uncertain = adjust(*(make_view("", points, 0.1, angles, joint).beams for points, joint in clouds), start, 0.1)
    results = (exact, uncertain)
    errors = [motion(start, result[0]) for result in results]
    squared = [error @ np.linalg.solve(result[1], error) for error, result in zip(errors, results, strict=True)]
    assert squared[0] > 60
    assert squared[1] < 25
    assert np.linalg.norm(errors[1]) < np.linalg.norm(errors[0]) / 2


def test_a_box_that_was_moved_between_the_scans_is_left_out():
    poses = [frames.rigid(np.eye(3), [0, 0, 1.0]), frames.rigid(frames.Rz(0.2), [0.3, 0.2, 1.1])]
    box = np.array([[[2.0, -1.0, 0.0], [3.0, 1.0, 2.0]]])
    clouds = []
    for k, T in enumerate(poses):
        boxes = np.concatenate([shell(5, 4, 3), box + 0.05 * k * np.eye(3)[0]])
        clouds.append(make_view(str(k), scan(boxes, T, 240, 361, k, 0.005), 0.1))
    truth = np.linalg.inv(poses[0]) @ poses[1]
    found = adjust(clouds[0].beams, clouds[1].beams, truth, 0.1)
    error = motion(truth, found[0])
    assert error @ np.linalg.solve(found[1], error) < 25
    assert np.linalg.norm(error[3:]) < 0.5e-3


def test_pieces_lie_on_the_walls():
    pose = frames.rigid(np.eye(3), [0.0, 0.0, 1.0])
    views = [make_view(str(k), scan(shell(5.1, 4.1, 3), pose, 240, 361, k, 0.005), 0.1) for k in range(2)]
    points = np.concatenate([view.beams.voxels_m for view in views])
    counts = np.concatenate([view.beams.counts for view in views])
    of_first = np.arange(len(points)) < len(views[0].beams.counts)
    cells = find_cells(points, counts, of_first, np.zeros((2, 3)), 0.1)
    x, y, z = np.abs(cells.centre_m - [0, 0, 0.5]).T
    off = np.min([np.abs(x - 5.1), np.abs(y - 4.1), np.abs(z - 1.5)], axis=0)
    large = cells.edge_m > 0.3
    assert large.sum() > 50
    assert off[large].max() < 0.01
    assert np.abs(cells.axes[large, 2]).max(axis=1).min() > 0.999


def test_what_cannot_be_told_of_the_calibration_is_one_line(command, tmp_path):
    clouds = [tmp_path / "a.npz", tmp_path / "b.npz"]
    for seed, path in enumerate(clouds):
        write_clouds(path, [Cloud(scan(room(), frames.rigid(np.eye(3), [0, 0, 1.0]), 60, 181, seed))])
    calibrated, designed = tmp_path / "calibrated.json", tmp_path / "designed.json"
    calibrated.write_text(scanner().to_json())
    designed.write_text(scanner().model_copy(update={"covariance": None}).to_json())
    for angles, says in ((designed, "has no covariance"), (calibrated, "a: no column joint_rad")):
        code, _, complaints = command("register", *clouds, "-o", tmp_path / "map.ply", "--angles", angles)
        assert code == 2
        assert len(complaints) == 1
        assert says in complaints[0]


def test_what_the_sigmas_leave_out_is_said_of_our_own_clouds(command, tmp_path):
    paths = [tmp_path / "a.npz", tmp_path / "b.npz"]
    for seed, path in enumerate(paths):
        points = scan(room(), frames.rigid(np.eye(3), [0.2 * seed, 0, 1.0]), 120, 181, seed)
        write_clouds(path, [Cloud(points, {"joint_rad": np.zeros(len(points), np.float32)})])
    code, out, _ = command("register", *paths, "-o", tmp_path / "map.ply")
    assert code == 0
    assert "note: sigmas assume exact scanner angles" in out
    assert "a: at (0.0000, 0.0000, 0.0000) m, the frame of the map" in out
    _, as_json, _ = command("register", *paths, "-o", tmp_path / "map.ply", "--json")
    assert json.loads(as_json)["complete"] is True


def test_leaves_keep_what_their_points_say():
    rng = np.random.default_rng(0)
    leaves = rng.uniform(-4, 4, (20_000, 3))
    leaves = leaves[np.linalg.norm(leaves, axis=1) > 1]
    a, b = (make_view(str(k), leaves + rng.normal(0, 0.01, leaves.shape), 0.1) for k in range(2))
    assert adjust(a.beams, b.beams, np.eye(4), 0.1) is None


def test_what_neighbours_share_counts_once():
    """Residuals that are alike within a block: as many blocks as there are, not as many points."""
    rng = np.random.default_rng(0)
    block = np.repeat(np.arange(400), 25)
    J = np.repeat(rng.normal(size=(400, 6)), 25, axis=0)
    squared, blind = [], []
    for _ in range(40):
        residual = np.repeat(rng.normal(0, 0.01, 400), 25) + rng.normal(0, 0.002, 10_000)
        inverse = np.linalg.inv(J.T @ J)
        error = inverse @ (J.T @ residual)
        squared.append(error @ np.linalg.solve(_sandwich(J, residual, block), error))
        blind.append(error @ np.linalg.solve(residual @ residual / 10_000 * inverse, error))
    assert 4 < np.mean(squared) < 9
    assert np.mean(blind) > 60
