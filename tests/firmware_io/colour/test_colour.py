"""Colours on clouds: a painted room, photographed by a slow camera of the test's own, comes out with its own paint."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from quick_tests import samples
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from benchmarks.firmware_io.calibration import designed
from benchmarks.firmware_io.rooms import FURNISHED, START_NS, Setup, Simulated, Truth, cast, simulate, write
from scanwright.design.camera import Camera
from scanwright.firmware_io.clouds.ply import read_header, read_ply

SETUP = Setup(beams=216, sweeps=((50.0, 360.0),), noise_m=0.01)
SIZE = (400, 300)
LENSES = {
    "pinhole": {"focal_px": [230.0, 225.0], "distortion": [-0.25, 0.06, 0.002, -0.001, -0.004]},
    "fisheye": {"focal_px": [120.0, 121.0], "distortion": [-0.02, 0.004, -0.001, 0.0002]},
}
PAINT = np.random.default_rng(7).integers(1, 255, (6 * (1 + len(FURNISHED.blocks)), 3)).astype(np.uint8)


def looking(forward):
    """Rotation vector of a camera that stands upright and looks somewhere."""
    z = np.array(forward) / np.linalg.norm(forward)
    x = np.cross(z, [0, 0, 1]) / np.hypot(*z[:2])
    return Rotation.from_matrix(np.stack([x, np.cross(z, x), z], axis=1)).as_rotvec(degrees=True).tolist()


ON_THE_HEAD = {"position_mm": [80, -60, 50], "rotvec_deg": looking([1.0, 0.4, 0.3])}


def camera(model, **more):
    values = {
        "model": model,
        "size_px": SIZE,
        "centre_px": [201.3, 147.9],
        "frame": "world",
        "position_mm": [3500, -2500, 800],
        "rotvec_deg": looking([-1.5, 4.5, -1.2]),
        "images": "shots.csv",
    }
    return values | LENSES[model] | more


def bent(model, coefficients, x, y):
    """Where the lens puts the direction (x, y, 1)."""
    r = np.hypot(x, y)
    if model == "fisheye":
        far = bent_angle(coefficients, np.arctan(r))
        return np.array([far * x, far * y]) / (r + 1e-300)
    k1, k2, p1, p2, k3 = coefficients
    stretch = 1 + k1 * r**2 + k2 * r**4 + k3 * r**6
    aside = [2 * p1 * x * y + p2 * (r**2 + 2 * x**2), p1 * (r**2 + 2 * y**2) + 2 * p2 * x * y]
    return np.array([x * stretch, y * stretch]) + aside


def bent_angle(coefficients, angle):
    return angle + sum(k * angle ** (3 + 2 * i) for i, k in enumerate(coefficients))


@given(model=st.sampled_from(list(LENSES)), x=st.floats(-0.7, 0.7), y=st.floats(-0.5, 0.5), far=st.floats(0.1, 50))
def test_the_lens_bends_as_its_formula_says(model, x, y, far):
    of = Camera.model_validate(camera(model, size_px=[4000, 4000], centre_px=[2000, 2000]))
    expected = np.array(bent(model, of.distortion, x, y)) * of.focal_px + of.centre_px
    np.testing.assert_allclose(of.pixels(far * np.array([[x, y, 1.0]]))[0], expected, atol=1e-9)


def test_nothing_is_seen_behind_nor_where_the_lens_folds_back():
    pinhole = Camera.model_validate(camera("pinhole", distortion=[-0.4, 0, 0, 0], size_px=[9000, 9000]))
    assert np.isnan(pinhole.pixels(np.array([[0.1, 0.1, -1.0], [3.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))).all()
    fisheye = Camera.model_validate(camera("fisheye", distortion=[], size_px=[9000, 9000], centre_px=[4500, 4500]))
    u, v = fisheye.pixels(np.array([[1.0, 0.0, -1.0]]))[0]
    assert u == pytest.approx(4500 + 120 * np.radians(135))
    assert v == pytest.approx(4500)


def rays(of):
    """The direction of every pixel in the camera, found by trying."""
    column, row = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    goal = ((np.stack([column, row], axis=-1).reshape(-1, 2) - of.centre_px) / of.focal_px).T
    if of.model == "fisheye":
        low, high = np.zeros(goal.shape[1]), np.full(goal.shape[1], np.pi)
        for _ in range(50):
            middle = (low + high) / 2
            beyond = bent_angle(of.distortion, middle) > np.hypot(*goal)
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        aside = np.sin(low) * goal / np.hypot(*goal)
        return np.stack([*aside, np.cos(low)], axis=1)
    at = goal.copy()
    for _ in range(100):
        at += 0.7 * (goal - bent(of.model, of.distortion, *at))
    assert np.abs(bent(of.model, of.distortion, *at) - goal).max() < 1e-9
    return np.stack([*at, np.ones_like(at[0])], axis=1)


def in_room(T_world_camera, directions):
    """What the rays of a camera hit."""
    R, t = T_world_camera[:3, :3], T_world_camera[:3, 3] + SETUP.position_m
    unit = directions / np.linalg.norm(directions, axis=1)[:, None] @ R.T
    return cast(FURNISHED, np.broadcast_to(t, unit.shape), unit)[1]


def pose_in_world(of, joint_rad):
    """Of the camera, written out once more."""
    turned = Rotation.from_euler("z", joint_rad) if of.frame != "world" else Rotation.identity()
    if of.frame == "laser":
        turned = turned * Rotation.from_euler("xy", SETUP.laser_deg, degrees=True)
    T = np.eye(4)
    T[:3, :3] = (turned * Rotation.from_rotvec(of.rotvec_deg, degrees=True)).as_matrix()
    T[:3, 3] = turned.apply(np.array(of.position_mm) / 1000)
    return T


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    """A recording of the painted room, its angle set, and the face that each of its beams hit."""
    folder = tmp_path_factory.mktemp("scanned")
    write(folder / "room.mcap", simulate(FURNISHED, SETUP, Truth(), 3))
    (folder / "angles.json").write_text(designed(SETUP).to_json())
    return folder


def task_with(folder, of):
    lines = [f"{key} = {json.dumps(value)}" for key, value in of.items()]
    task = ["name = 'painted'", "sensor = 'UTM-30LX'", "servo = 'MX-64R'", "slip_ring = 'UH1256-02-0610-06S'"]
    text = [*task, "[motion]", "period_s = 6.0", "[[weight]]", "shape = 'all'", "[camera]", *lines]
    (folder / "task.toml").write_text("\n".join(text))
    return folder / "task.toml"


def photograph(folder, of, column, shots):
    """Render and save an image for each joint angle; where each was taken, and what it shows."""
    taken, lines = [], [f"file,{column}"]
    directions = rays(of)
    for k, (value, joint_rad) in enumerate(shots):
        T = pose_in_world(of, joint_rad)
        face = in_room(T, directions)
        Image.fromarray(PAINT[face].reshape(SIZE[1], SIZE[0], 3)).save(folder / f"{k}.png")
        lines.append(f"{k}.png,{value}")
        taken.append((T, face.reshape(SIZE[::-1])))
    (folder / "shots.csv").write_text("\n".join(lines) + "\n", encoding="utf-8-sig")
    return taken


SHOTS = {
    ("pinhole", "world"): ("joint_deg", [(0, 0.0)]),
    ("fisheye", "rot"): ("joint_deg", [(np.degrees(a), a) for a in (0.3, 2.2, 4.4)]),
    ("pinhole", "laser"): ("time_ns", [(START_NS + round(t * 1e9), np.radians(50 * t)) for t in (1.3, 4.4)]),
}


@pytest.mark.parametrize(("model", "frame"), samples(SHOTS, [("pinhole", "world"), ("pinhole", "laser")]))
def test_points_get_the_paint_of_what_they_lie_on(scanned, command, tmp_path, model, frame):
    of = camera(model, frame=frame) | ({} if frame == "world" else ON_THE_HEAD)
    seen = photograph(tmp_path, Camera.model_validate(of), *SHOTS[model, frame])
    out = tmp_path / "room.ply"
    words = ("--angles", scanned / "angles.json", "--camera", task_with(tmp_path, of), "-o", out)
    code, said, _ = command("assemble", scanned / "room.mcap", *words)
    assert code == 0, said
    cloud = read_ply(out)
    assert f"wrote {cloud.size:,} points of " in said
    assert command("assemble", scanned / "room.mcap", *words[:-1], tmp_path / "o.ply", "--organised")[0] == 0
    organised = read_ply(tmp_path / "o.ply")
    assert read_header(tmp_path / "o.ply").width and not read_header(out).width
    assert organised[np.isfinite(organised["x"])].tobytes() == cloud.tobytes()
    points_m = np.stack([cloud[axis] for axis in "xyz"], axis=1).astype(float)
    range_m = np.linalg.norm(points_m, axis=1)
    scanner = np.broadcast_to(np.array(SETUP.position_m), points_m.shape)
    _, face = cast(FURNISHED, scanner, points_m / range_m[:, None])
    coloured = cloud["alpha"] == 255
    rgb = np.stack([cloud[name] for name in ("red", "green", "blue")], axis=1)
    assert not rgb[~coloured].any()
    right = (rgb == PAINT[face]).all(axis=1)

    expected = np.zeros(len(points_m), bool)  # well inside a face, in plain sight of an image
    blocked = np.full(len(points_m), True)  # behind something in every image that it would be in
    for T, shown in seen:
        to = points_m - T[:3, 3]
        far = np.linalg.norm(to, axis=1)
        free_m, _ = cast(FURNISHED, np.broadcast_to(T[:3, 3] + SETUP.position_m, to.shape), to / far[:, None])
        pixel = Camera.model_validate(of).pixels(to @ T[:3, :3])
        inside = np.isfinite(pixel).all(axis=1)
        u, v = np.rint(np.where(inside[:, None], pixel, 0)).astype(int).T
        plain = inside & (u > 9) & (v > 9) & (u < SIZE[0] - 10) & (v < SIZE[1] - 10)
        for dv in range(-8, 9, 4):
            for du in range(-8, 9, 4):
                plain[plain] &= shown[v[plain] + dv, u[plain] + du] == face[plain]
        flat = np.abs(free_m - far) < 0.05
        expected |= plain & flat
        hit_m = T[:3, 3] + to * (free_m / far)[:, None]
        known = cKDTree(points_m).query(hit_m, distance_upper_bound=0.05)[0] < 0.05
        blocked &= inside & (free_m < far - 0.4) & known  # what the scanner has not seen hides nothing
    assert expected.sum() > 1000
    assert right[expected & coloured].mean() > 0.999
    assert coloured[expected].mean() > 0.92
    if frame == "world":  # on the head it sees what the lidar sees
        assert blocked.sum() > 500
        assert coloured[blocked].mean() < 0.08
    assert right[coloured].mean() > 0.94  # those on edges among them
    assert f"coloured {coloured.sum():,} points" in said


def carried(time_s):
    """Where the platform is after some seconds: it drives a curve and rocks; rotations and positions."""
    turned = np.stack([0.05 * np.sin(time_s), 0.03 * np.cos(2 * time_s), 0.15 * time_s], axis=-1)
    at = np.stack([-0.3 * time_s, 0.1 * time_s + 0.05 * np.sin(time_s), 0.02 * np.sin(2 * time_s)], axis=-1)
    return Rotation.from_rotvec(turned), at


@pytest.fixture(scope="module")
def driven(tmp_path_factory):
    """A recording made from a moving platform, its poses, and the face that each of its beams hit."""
    folder = tmp_path_factory.mktemp("driven")
    made = simulate(FURNISHED, SETUP, Truth(), 3)
    laser = Rotation.from_euler("xy", SETUP.laser_deg, degrees=True)
    rng = np.random.default_rng(5)
    scans, faces = [], []
    for scan in made.scans:
        after_s = (scan.time_ns - START_NS) / 1e9
        joint_rad = np.interp(after_s, (made.log.time_ns - START_NS) / 1e9, made.log.position_rad)
        b = scan.bearing_rad
        fan = laser.apply(np.column_stack([np.cos(b), np.sin(b), np.zeros(b.size)]))
        platform, at = carried(after_s)
        range_m, face = cast(
            FURNISHED, at + SETUP.position_m, platform.apply(Rotation.from_euler("z", joint_rad[:, None]).apply(fan))
        )
        scans.append(replace(scan, range_m=(range_m + rng.normal(0, SETUP.noise_m, b.size)).astype(np.float32)))
        faces.append(face)
    write(folder / "room.mcap", Simulated(scans, made.log))
    (folder / "angles.json").write_text(designed(SETUP).to_json())
    pose_s = np.arange(-0.2, SETUP.sweeps[0][1] / SETUP.sweeps[0][0] + 0.2, 0.01)
    platform, at = carried(pose_s)
    with (folder / "poses.csv").open("w") as stream:
        stream.write("time_ns,x,y,z,qx,qy,qz,qw\n")
        for t, p, q in zip(pose_s.tolist(), at.tolist(), platform.as_quat().tolist(), strict=True):
            stream.write(",".join(map(str, [START_NS + round(t * 1e9), *p, *q])) + "\n")
    return folder, np.concatenate(faces)


def test_on_a_moving_platform_each_image_has_its_own_pose(driven, command, tmp_path):
    folder, face = driven
    values = camera("pinhole", frame="laser") | ON_THE_HEAD
    of = Camera.model_validate(values)
    lines, seen = ["file,time_ns"], []
    for k, after_s in enumerate((1.3, 4.4)):
        platform, at = carried(np.array(after_s))
        T_map_platform = np.eye(4)
        T_map_platform[:3, :3], T_map_platform[:3, 3] = platform.as_matrix(), at
        T = T_map_platform @ pose_in_world(of, np.radians(50.0 * after_s))
        shown = in_room(T, rays(of))
        Image.fromarray(PAINT[shown].reshape(SIZE[1], SIZE[0], 3)).save(tmp_path / f"{k}.png")
        lines.append(f"{k}.png,{START_NS + round(after_s * 1e9)}")
        seen.append((T, shown.reshape(SIZE[::-1])))
    (tmp_path / "shots.csv").write_text("\n".join(lines) + "\n")
    words = ("--angles", folder / "angles.json", "--poses", folder / "poses.csv")
    out = tmp_path / "room.ply"
    more = ("--camera", task_with(tmp_path, values), "-o", out)
    code, said, _ = command("assemble", folder / "room.mcap", *words, *more)
    assert code == 0, said
    cloud = read_ply(out)
    points_m = np.stack([cloud[axis] for axis in "xyz"], axis=1).astype(float)
    coloured = cloud["alpha"] == 255
    right = (np.stack([cloud[name] for name in ("red", "green", "blue")], axis=1) == PAINT[face]).all(axis=1)
    plain, edge = np.zeros(face.size, bool), np.zeros(face.size, bool)
    for T, shown in seen:
        to = points_m - T[:3, 3]
        far_m = np.linalg.norm(to, axis=1)
        free_m, _ = cast(FURNISHED, np.broadcast_to(T[:3, 3] + SETUP.position_m, to.shape), to / far_m[:, None])
        x, y, z = (to @ T[:3, :3]).T
        front = (np.abs(free_m - far_m) < 0.05) & (z > np.hypot(x, y) / 1.2)
        u, v = np.full((2, face.size), -1)
        at_px = bent("pinhole", of.distortion, x[front] / z[front], y[front] / z[front]).T * of.focal_px + of.centre_px
        u[front], v[front] = np.rint(at_px).clip(-1, 9999).astype(int).T
        within = (u > 9) & (v > 9) & (u < SIZE[0] - 10) & (v < SIZE[1] - 10)
        alone = within.copy()  # nothing else near its pixel
        for dv in range(-8, 9, 4):
            for du in range(-8, 9, 4):
                alone[alone] &= shown[v[alone] + dv, u[alone] + du] == face[alone]
        plain |= alone
        edge |= within & ~alone
    expected = plain & ~edge
    assert expected.sum() > 1000
    assert right[expected & coloured].mean() > 0.999
    assert coloured[expected].mean() > 0.9
    assert right[coloured].mean() > 0.94
