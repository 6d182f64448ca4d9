"""Registration: what is thinned, found, believed, refused, solved and merged; simulated halls and a real room."""

from itertools import pairwise

import numpy as np
import pytest
import small_gicp
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.image import imread
from scipy.optimize import least_squares
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from benchmarks.firmware_io.registration import building, room, scan, shell
from scanwright.design import frames
from scanwright.design.errors import RecordingError
from scanwright.design.progress import no_progress
from scanwright.firmware_io.clouds.cloud import Cloud, pose_matrix
from scanwright.firmware_io.clouds.formats import read_clouds, write_clouds
from scanwright.firmware_io.registration.cube_map import cells_of, depth_map, solid_angles_sr
from scanwright.firmware_io.registration.pairwise import align
from scanwright.firmware_io.registration.poses import read_poses, write_poses
from scanwright.firmware_io.registration.register import Edge, register, solve_graph
from scanwright.firmware_io.registration.sensor_view import make_view
from scanwright.firmware_io.registration.start import find_start
from scanwright.firmware_io.registration.thin import beam_step_rad, line_gaps_rad, merge, thin, voxel_means


def pose(yaw_deg, x, y, z=1.0, tilt_deg=0.0):
    return frames.rigid(frames.Rz(np.radians(yaw_deg)) @ frames.Rx(np.radians(tilt_deg)), [x, y, z])


def off_by(T, truth):
    """What a pose is off by: metres and degrees."""
    D = np.linalg.inv(truth) @ T
    return np.linalg.norm(D[:3, 3]), np.degrees(np.linalg.norm(Rotation.from_matrix(D[:3, :3]).as_rotvec()))


def seen(boxes, T, seed, lines=180, beams=541, spacing_m=0.15):
    return make_view(f"stand{seed}", scan(boxes, T, lines, beams, seed), spacing_m)


# What a scanner's density is


def test_the_cells_of_a_cube_map_share_out_the_sphere():
    side = 12
    area = solid_angles_sr(side)
    assert area.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    directions = np.random.default_rng(0).normal(size=(200_000, 3))
    count = np.bincount(cells_of(directions, side), minlength=area.size)
    expected = len(directions) * area / area.sum()
    assert np.sum((count - expected) ** 2 / expected) < area.size + 5 * np.sqrt(2 * area.size)


def test_a_depth_map_holds_the_nearest_and_the_farthest():
    directions = np.random.default_rng(1).normal(size=(50_000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    depth = depth_map(np.concatenate([2 * directions, 5 * directions]), 10)
    np.testing.assert_allclose(depth.near_m, 2)
    np.testing.assert_allclose(depth.far_m, 5)


def test_gaps_between_lines_are_those_of_the_closed_form():
    """A fan whose scan plane is tilted by gamma: gap = dpsi sqrt(sin^2 gamma - cos^2 theta) / branches."""
    gamma, lines, beams = np.radians(60), 240, 721
    phi = np.radians(np.linspace(-90, 90, beams))  # cos(theta) = sin(gamma) sin(phi): one branch
    plane = np.column_stack([np.cos(phi), np.sin(phi), np.zeros(beams)]) @ frames.Rx(gamma).T
    directions = (plane @ np.swapaxes(frames.Rz(np.arange(lines) * 2 * np.pi / lines), 1, 2)).reshape(-1, 3)
    assert beam_step_rad(2.0 * directions) == pytest.approx(np.radians(0.25), rel=1e-6)
    gap = line_gaps_rad(3.0 * directions, np.ones(len(directions), int), np.radians(0.25))
    expected = 2 * np.pi / lines * np.sqrt(np.maximum(np.sin(gamma) ** 2 - directions[:, 2] ** 2, 0))
    smooth = np.abs(directions[:, 2]) < 0.75
    ratio = gap[smooth] / expected[smooth]
    assert np.median(ratio) == pytest.approx(1, abs=0.02)
    assert np.percentile(np.abs(ratio - 1), 90) < 0.15


@settings(deadline=None)  # the first example compiles
@given(
    st.lists(st.tuples(*[st.floats(-3, 3)] * 3), min_size=1, max_size=60),
    st.lists(st.integers(0, 2), min_size=60, max_size=60),
)
def test_voxel_means_are_those_of_the_slow_obvious_loop(points, levels):
    points, level = np.array(points), np.array(levels[: len(points)], np.uint8)
    voxels = {}
    for row, k in zip(points, level, strict=True):
        voxels.setdefault((int(k), *np.floor(row / (0.5 * 2.0**k)).astype(int)), []).append(row)
    means, counts = voxel_means(points, points, 0.5, level)
    np.testing.assert_allclose(means, [np.mean(rows, axis=0) for rows in voxels.values()], atol=1e-12)
    assert counts.tolist() == [len(rows) for rows in voxels.values()]


def test_thinning_undoes_the_density_of_the_scanner():
    points = scan(room(), pose(0, 0, 0), 360, 541, 0)
    voxels = voxel_means(points, points, 0.15, np.zeros(len(points), np.uint8))
    floor = thin(*voxels, 0.15, beam_step_rad(points))
    floor = floor[floor[:, 2] < -0.9]
    raw = points[points[:, 2] < -0.9]

    def per_m2(cloud, near, far):
        r = np.hypot(cloud[:, 0], cloud[:, 1])
        return np.count_nonzero((r > near) & (r < far)) / (far**2 - near**2)

    assert per_m2(raw, 1, 2) > 8 * per_m2(raw, 4, 5)
    assert per_m2(floor, 1, 2) < 1.3 * per_m2(floor, 4, 5)


# Pairs


@pytest.fixture(scope="module")
def stands():
    """Two stands in one room."""
    poses = pose(0, 0, 0), pose(40, 2.2, -1.5, 1.1, tilt_deg=3)
    return *(seen(room(), T, k, lines=360) for k, T in enumerate(poses)), np.linalg.inv(poses[0]) @ poses[1]


def test_a_pair_is_found_from_no_start_to_a_millimetre(stands):
    a, b, truth = stands
    pair = find_start(a, b)
    assert pair.why_not == ()
    metres, degrees = off_by(pair.T_a_b, truth)
    assert metres < 1e-3
    assert degrees < 0.01
    sigma_m = np.sqrt(pair.covariance[3:, 3:].trace())
    assert metres < 5 * sigma_m < 5e-3


def test_both_ways_round_agree(stands):
    a, b, truth = stands
    there, back = align(a, b, truth), align(b, a, np.linalg.inv(truth))
    metres, degrees = off_by(there.T_a_b @ back.T_a_b, np.eye(4))
    assert metres < 1e-3
    assert degrees < 0.01


def test_a_wrong_pose_is_not_believed(stands):
    a, b, truth = stands
    assert align(a, b, truth @ pose(90, 3, 0, 0)).why_not


def test_a_start_without_any_overlap_is_refused(stands):
    a, b, _ = stands
    pair = align(a, b, pose(0, 500, 0))
    assert any("lie on the other cloud" in why for why in pair.why_not)


def test_a_corridor_is_refused_with_its_direction():
    boxes = shell(60, 1.2, 2.5)
    a, b = seen(boxes, pose(0, 0, 0.1), 0), seen(boxes, pose(0, 0.5, 0.1), 1)
    pair = align(a, b, np.eye(4))
    assert any("it can slide along (1.00, " in why for why in pair.why_not)


def test_a_hall_that_looks_alike_from_both_ends_is_refused():
    boxes = shell(6, 4, 3)
    pair = find_start(seen(boxes, pose(0, 1, 0.5), 0), seen(boxes, pose(30, -1.5, 1), 1))
    assert any("another pose" in why for why in pair.why_not)


def test_the_two_sides_of_a_thin_wall_do_not_settle_on_each_other():
    wall = np.array([[[-0.08, -4.0, 0], [0.08, 1.0, 2.6]]])
    things = np.array([[[3, -2, 0], [3.6, -1, 1.2]], [[-3, 2, 0], [-2, 2.5, 0.8]], [[-2, -3, 0], [-1.5, -2, 1.9]]])
    boxes = np.concatenate([shell(5, 4, 2.6), wall, things])
    poses = pose(0, -2, 1.5), pose(10, 2, 1.5)
    a, b = (seen(boxes, T, k) for k, T in enumerate(poses))
    truth = np.linalg.inv(poses[0]) @ poses[1]
    pair = align(a, b, truth @ pose(2, 0.1, 0, 0))
    assert pair.why_not == ()
    assert off_by(pair.T_a_b, truth)[0] < 3e-3


def test_bare_ground_gives_no_start_and_no_identity():
    ground = shell(40, 40, 60)[:1]
    pair = find_start(seen(ground, pose(0, 0, 0), 0), seen(ground, pose(20, 1, 0), 1))
    assert not np.array_equal(pair.T_a_b, np.eye(4))
    assert pair.why_not


def test_too_few_points_are_one_line():
    with pytest.raises(RecordingError, match=r"few: 3 points 0\.1 m apart"):
        make_view("few", np.eye(3), 0.1)


# Graphs


def some_graph(seed, noise):
    """Random poses in a ring, noisy edges between neighbours and next neighbours."""
    rng = np.random.default_rng(seed)
    poses = np.array(
        [frames.rigid(Rotation.random(random_state=rng).as_matrix(), rng.normal(0, 5, 3)) for _ in range(6)]
    )
    poses[0] = np.eye(4)
    edges = []
    for i in range(6):
        for j in ((i + 1) % 6, (i + 2) % 6):
            w = noise * rng.normal(size=6)
            T = np.linalg.inv(poses[i]) @ poses[j] @ frames.rigid(frames.rotvec_to_matrix(w[:3]), w[3:])
            edges.append(Edge(i, j, T, np.diag(rng.uniform(0.5, 2, 6)) * 1e-6))
    return poses, edges


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 1000))
def test_exact_edges_bring_back_the_poses(seed):
    poses, edges = some_graph(seed, 0.0)
    rng = np.random.default_rng(seed)
    start = np.array([T @ pose(*rng.uniform(-10, 10, 1), *rng.uniform(-0.5, 0.5, 2), 0.0) for T in poses])
    start[0] = poses[0]
    graph = solve_graph(start, edges)
    np.testing.assert_allclose(graph.T_world, poses, atol=1e-8)
    assert graph.scale == 1
    assert graph.left_out == ()


def test_a_general_solver_finds_the_same_minimum_and_covariance():
    poses, edges = some_graph(3, 1e-3)
    graph = solve_graph(poses, edges)

    def unpacked(x):
        moves = [np.eye(4), *(frames.rigid(frames.rotvec_to_matrix(m[:3]), m[3:]) for m in x.reshape(5, 6))]
        return graph.T_world @ np.array(moves)

    def residuals(x):
        T, out = unpacked(x), []
        for edge in edges:
            D = np.linalg.inv(edge.T_i_j) @ np.linalg.inv(T[edge.i]) @ T[edge.j]
            r = np.concatenate([Rotation.from_matrix(D[:3, :3]).as_rotvec(), D[:3, 3]])
            out.append(r / np.sqrt(np.diag(edge.covariance)))
        return np.concatenate(out)

    found = least_squares(residuals, np.zeros(30), x_scale=1e-3, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert np.abs(found.x).max() < 2e-6
    covariance = np.linalg.inv(found.jac.T @ found.jac) * graph.scale**2
    for k in range(1, 6):
        block = covariance[6 * k - 6 : 6 * k, 6 * k - 6 : 6 * k]
        np.testing.assert_allclose(graph.covariance[k], block, atol=0.01 * np.abs(block).max())


def test_the_one_edge_that_contradicts_all_others_is_left_out():
    poses, edges = some_graph(4, 1e-3)
    lie = Edge(0, 3, np.linalg.inv(poses[0]) @ poses[3] @ pose(0, 9, 0, 0), np.eye(6) * 1e-6)
    graph = solve_graph(poses, [*edges, lie])
    assert graph.left_out == (lie,)
    assert np.abs(graph.T_world - poses).max() < 0.02


def test_poses_that_no_edge_joins_are_a_bug():
    poses, edges = some_graph(5, 0.0)
    with pytest.raises(ValueError, match="do not connect"):
        solve_graph(poses, [edge for edge in edges if 3 not in (edge.i, edge.j)])


# Sessions


def test_a_building_closes_within_a_centimetre():
    boxes, stands = building()
    views = [seen(boxes, T, k, lines=120, beams=181) for k, T in enumerate(stands)]
    rng = np.random.default_rng(0)
    walked = [stands[0]]  # what a robot's wheels say: 20 cm and 2 deg more wrong with every stand
    for here, there in pairwise(stands):
        slip = pose(rng.normal(0, 2), *rng.normal(0, 0.2, 2), 0.0)
        walked.append(walked[-1] @ np.linalg.inv(here) @ there @ slip)
    assert off_by(walked[-1], stands[-1])[0] > 0.5
    found = register(views, walked, no_progress)
    assert found.complete
    assert max(off_by(T, truth)[0] for T, truth in zip(found.T_world, stands, strict=True)) < 0.01
    believed = {(pair.a, pair.b) for pair in found.pairs if not pair.why_not}
    assert ("stand0", "stand19") in believed


def test_places_that_look_alike_are_not_joined():
    """The building is nearly the same after half a turn, and its doors repeat every 9 m."""
    boxes, stands = building()
    near, far = stands[0], stands[8]
    views = [seen(boxes, T, k, lines=120, beams=181) for k, T in enumerate((near, far))]
    found = register(views, [near, far], no_progress)
    assert not found.complete
    assert "m from the start that was given" in found.pairs[0].why_not[-1]

    # every pair of neighbours of this chain fits, as of one that is found without initial poses
    at = (0, 8, 10, 14, 16)
    chain = [(0, 0, 0), (3.2, 4.85, 7.36), (107.2, 0, 0), (93.2, 0.27, 0.41), (-160.8, -1.92, -2.91)]
    views = [*views, *(seen(boxes, stands[k], k, lines=120, beams=181) for k in at[2:])]
    wrong = register(views, [pose(*place, z=0.0) for place in chain], no_progress)
    assert np.isfinite(wrong.T_world).all()
    assert wrong.conflicts
    assert not wrong.complete


def write_scans(folder, boxes, poses):
    paths = []
    for k, T in enumerate(poses):
        paths.append(folder / f"stand{k}.ply")
        write_clouds(paths[-1], [Cloud(scan(boxes, T, 180, 541, k).astype(np.float32), start_ns=10**9 * (k + 1))])
    return paths


def test_what_cannot_be_joined_is_named_and_nothing_is_written(command, tmp_path):
    (other,) = write_scans(tmp_path, shell(2, 1.5, 2.4), [pose(0, 0.3, 0.2)])
    other = other.rename(tmp_path / "cellar.ply")
    paths = write_scans(tmp_path, room(), [pose(0, 0, 0), pose(20, 2.2, -1.5)])
    code, out, complaints = command("register", *paths, other, "-o", tmp_path / "map.ply", "--spacing-m", "0.2")
    assert code == 1
    assert complaints == []
    assert "stand0 - cellar: not used: " in out
    assert "stand1 - cellar: not used: " in out
    assert "no place was found for cellar: nothing is written" in out
    assert not list(tmp_path.glob("map*"))


def test_given_poses_stay_in_their_world(command, tmp_path):
    truth = [pose(15, 100, 50), pose(60, 101.5, 51)]
    clouds = [
        Cloud(scan(room(), pose(0, 0, 0), 180, 541, 0)),
        Cloud(scan(room(), np.linalg.inv(pose(15, 100, 50, 0)) @ truth[1], 180, 541, 1)),
    ]
    names = ["a", "b"]
    for name, cloud in zip(names, clouds, strict=True):
        write_clouds(tmp_path / f"{name}.npz", [cloud])
    start = [truth[0], truth[1] @ pose(3, 0.2, -0.1, 0.0)]
    write_poses(tmp_path / "start.tum", names, clouds, np.array(start))
    code, out, _ = command(
        *("register", tmp_path / "a.npz", tmp_path / "b.npz", "-o", tmp_path / "map.e57"),
        *("--start", tmp_path / "start.tum", "--poses", tmp_path / "poses.tum"),
    )
    assert code == 0, out
    found = read_poses(tmp_path / "poses.tum", ["a", "b"])
    np.testing.assert_allclose(found[0], truth[0], atol=1e-8)
    assert off_by(found[1], truth[1])[0] < 2e-3
    (merged,), _ = read_clouds(tmp_path / "map.e57")
    assert np.abs(np.median(merged.points_m, axis=0)[:2] - [100, 50]).max() < 5
    assert merged.columns["count"].sum() == sum(len(cloud.points_m) for cloud in clouds)
    assert imread(tmp_path / "map.png").shape[1] > 1000
    rows = np.genfromtxt(tmp_path / "poses.cov.csv", delimiter=",", names=True, dtype=None, encoding="utf-8")
    assert rows["cloud"].tolist() == names
    assert rows["x_x"][0] == 0
    assert 1e-5 < np.sqrt(rows["x_x"][1]) < 2e-3


def test_wrong_input_is_one_line(command, tmp_path):
    one, other = write_scans(tmp_path, shell(2, 1.5, 2.4), [pose(0, 0, 0)] * 2)
    (tmp_path / "p.tum").write_text("0 1 2 3 0 0 0 1\n")
    (tmp_path / "r.mcap").touch()
    for words, says in (
        ([one], "1 cloud: register needs at least two"),
        ([one, other, "--start", tmp_path / "p.tum"], "1 poses for 2 clouds"),
        ([one, other, "--spacing-m", "0"], "--spacing-m = 0.0: must be above 0"),
        ([one, other, "--poses", tmp_path / "no/p.tum"], "does not exist"),
        ([one, one], "given twice"),
        ([one, tmp_path], "is a folder; name a file of a cloud"),
        ([one, tmp_path / "r.mcap"], "`scanwright assemble`"),
        ([one, tmp_path / "absent.las"], "absent.las: cannot read: No such file"),
    ):
        code, _, complaints = command("register", *words, "-o", tmp_path / "map.ply")
        assert code == 2
        assert len(complaints) == 1
        assert says in complaints[0]


def test_convert_says_what_is_lost(command, tmp_path):
    (one,) = write_scans(tmp_path, shell(2, 1.5, 2.4), [pose(0, 0, 0)])
    code, out, _ = command("convert", one, tmp_path / "c.laz")
    assert code == 0
    assert "note: LAS rounds coordinates to 0.1 mm" in out
    (before,), _ = read_clouds(one)
    (after,), _ = read_clouds(tmp_path / "c.laz")
    np.testing.assert_allclose(after.points_m, before.points_m, atol=1e-4)


def test_a_map_is_the_mean_of_what_fell_into_each_voxel():
    clouds = [
        Cloud(np.array([[0.01, 0, 0], [np.nan] * 3]), {"intensity": np.array([10, 0], np.float32)}),
        Cloud(np.array([[0.03, 0, 0], [5.01, 0, 0]]), {"intensity": np.array([30, 7], np.float32)}),
    ]
    merged = merge(clouds, np.array([np.eye(4), pose(0, 0, 0.02, 0)]), 0.1)
    np.testing.assert_allclose(merged.points_m, [[0.02, 0.01, 0], [5.01, 0.02, 0]], atol=1e-6)
    assert merged.columns["count"].tolist() == [2, 1]
    assert merged.columns["intensity"].tolist() == [20, 7]


def test_the_real_room_from_no_start(command, data, tmp_path):
    """Against plain small_gicp from the start that is known to be good (data/README.md)."""
    paths = [data / "clouds" / f"room_scan{k}.pcd" for k in (1, 2)]
    code, out, _ = command("register", *paths, "-o", tmp_path / "map.ply")
    assert code == 0, out
    assert "sigmas assume" not in out  # nobody knows whose angles they were
    _, T = read_poses(tmp_path / "map.tum", ["room_scan1", "room_scan2"])
    one, two = (read_clouds(path)[0][0].points_m.astype(float) for path in paths)
    start = frames.rigid(frames.Rz(0.6931), [1.79387, 0.720047, 0])
    (target, tree), (source, _) = (small_gicp.preprocess_points(points, 0.1, 20, 1) for points in (one, two))
    known = small_gicp.align(target, source, tree, start, max_iterations=100)
    metres, degrees = off_by(T, known.T_target_source)
    assert metres < 0.05
    assert degrees < 1
    moved = frames.apply(T, two)
    assert np.mean(cKDTree(one).query(moved, distance_upper_bound=0.1)[0] < 0.1) > 0.57
    assert np.mean(cKDTree(moved).query(one, distance_upper_bound=0.1)[0] < 0.1) > 0.67


def test_tum_lines_bring_poses_back(tmp_path):
    poses = [pose(30, 1, -2, 3, tilt_deg=5), pose_matrix([4, 5, 6, 0.5, 0.5, 0.5, -0.5])]
    clouds = [Cloud(np.zeros((1, 3)), start_ns=1_763_000_000_000_000_001), Cloud(np.zeros((1, 3)))]
    write_poses(tmp_path / "p.tum", ["a", "b"], clouds, np.array(poses))
    np.testing.assert_allclose(read_poses(tmp_path / "p.tum", ["a", "b"]), poses, atol=1e-8)
    assert "1763000000.000000001 1.000000000" in (tmp_path / "p.tum").read_text()


def test_poses_go_to_the_clouds_that_the_comments_name(tmp_path):
    path = tmp_path / "p.tum"
    poses = [pose(30, 1, -2, 3), pose(60, 4, 5, 6)]
    write_poses(path, ["a", "b"], [Cloud(np.zeros((1, 3)))] * 2, np.array(poses))
    np.testing.assert_allclose(read_poses(path, ["b", "a"]), poses[::-1], atol=1e-8)
    with pytest.raises(RecordingError, match=r"p\.tum: its comments name a, b, the clouds are a, c: leave"):
        read_poses(path, ["a", "c"])
    lines = [line for line in path.read_text().splitlines() if not line.startswith("# ") or "qw" in line]
    path.write_text("\n".join(lines), encoding="utf-8-sig")
    np.testing.assert_allclose(read_poses(path, ["b", "a"]), poses, atol=1e-8)
