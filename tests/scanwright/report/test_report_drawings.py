"""What the report draws: the scanner in the world, densities on a ball, the places of checks."""

from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest
from report_folder import ANGLES, Page, cell, drawn, own_body, picture, sphere

from scanwright.design.motion import Sweep
from scanwright.design.scene.ray_caster import build_scene
from scanwright.design.task.task import load_task
from scanwright.report.check_pictures import CheckPictures, PlacedBody, bodies_named
from scanwright.report.colours import bands_to, ramp
from scanwright.report.density_sphere import SHADES
from scanwright.report.page import report_html
from scanwright.report.scanner_scene import load_glb, placed_bodies


def world_points(body, key):
    T = np.reshape(body[key], (4, 4)).T
    points = np.frombuffer(b64decode(body["vertices"]), "<u2").reshape(-1, 3) / 65535
    return points @ T[:3, :3].T + T[:3, 3]


def test_the_scene_stands_in_the_world_and_turns_about_the_axis(folder):
    shown = drawn(folder, ANGLES, own_body())
    base, lidar = shown["bodies"]
    assert [base["name"], base["turns"], lidar["name"], lidar["turns"]] == ["base_mount", False, "lidar_body", True]
    np.testing.assert_allclose(base["colour"], [0.735, 0, 1], atol=3e-3)  # sRGB of half the light
    behind = ANGLES.T_world_rot(0.0) @ [0, 0, -0.1, 1]
    np.testing.assert_allclose(world_points(base, "matrix").mean(axis=0), behind[:3], atol=1e-6)
    for key, height in (("matrix", -0.1), ("apart", 0.2)):
        expected = ANGLES.T_world_laser(0.0) @ [0, 0, height, 1]
        np.testing.assert_allclose(world_points(lidar, key).mean(axis=0), expected[:3], atol=1e-6)
    A = np.reshape(shown["axis"], (4, 4)).T
    np.testing.assert_allclose(A, ANGLES.T_world_rot(0.0), atol=1e-8)
    np.testing.assert_allclose(A @ np.reshape(shown["axis_inverse"], (4, 4)).T, np.eye(4), atol=1e-8)
    np.testing.assert_allclose(np.reshape(shown["laser"], (4, 4)).T, ANGLES.T_world_laser(0.0), atol=1e-8)
    faces = np.frombuffer(b64decode(base["faces"]), "<u2")
    assert len(faces) == 36 and faces.max() < len(world_points(base, "matrix"))
    for fit, key in (("fit", "matrix"), ("fit_apart", "apart")):
        points = np.concatenate([world_points(body, key) for body in shown["bodies"]])
        assert np.linalg.norm(points - shown[fit]["centre"], axis=1).max() <= shown[fit]["radius"] + 1e-6


def test_the_fan_knows_what_is_hidden_at_every_axis_step(folder):
    shadow, bearings = own_body()
    fan = drawn(folder, ANGLES, (shadow, bearings))["fan"]
    np.testing.assert_allclose(np.frombuffer(b64decode(fan["bearings"]), "<f4"), bearings, atol=1e-6)
    hidden = np.zeros((len(bearings), fan["steps"]), bool)
    for beam, bits in fan["hidden"].items():
        row = b64decode(bits)
        # as the page reads it
        hidden[int(beam)] = [row[step >> 3] >> (7 - (step & 7)) & 1 for step in range(fan["steps"])]
    np.testing.assert_array_equal(hidden, shadow.stator | shadow.beams[:, None])
    assert hidden.mean() == pytest.approx(shadow.share())


def test_a_sweep_stays_within_its_limits(folder):
    sweep = ANGLES.model_copy(update={"motion": Sweep(limits_deg=(-90, 80), period_s=12.0)})
    shown = drawn(folder, sweep, None)
    assert (shown["limits_deg"], shown["to_and_fro"], shown["period_s"]) == ([-90, 80], True, 12.0)
    assert shown["fan"] is None


def test_a_scanner_too_large_for_a_page_is_left_out(folder, monkeypatch):
    monkeypatch.setattr("scanwright.report.page.LARGEST_BYTES", 100)
    page = Page(report_html(folder))
    assert "too much for one page" in page.text["result"] and "spin" not in page.ids


def test_the_pictures_of_the_sphere_show_what_is_where():
    loaded = load_task(Path("ground_ahead"))
    ball = sphere(loaded)
    assert [shown.title for shown in ball.maps] == [
        "density of this scanner, without parts",
        "density of rolling, without parts",
        "density of pitching, without parts",
        "density of upright, one tilt, without parts",
        "density of Bonn, 45 deg, without parts",
    ]
    own, rolling, pitching, *_ = (picture(shown.picture) for shown in ball.maps)
    assert own.tobytes() == rolling.tobytes() != pitching.tobytes()
    bright = tuple(ramp(np.linspace(0, 1, SHADES))[-1].tolist())
    # rolling is densest along its axis, ahead and behind; behind it sees nothing within 43 deg, and the robot is there
    assert own.getpixel(cell(np.array([1, 0, 0]))) == bright
    assert own.getpixel(cell(np.array([-1, 0.2, 0.2]))) == (255, 255, 255)
    assert own.getpixel(cell(np.array([-1, 0, -0.5]))) in [(221, 221, 221), (119, 119, 119)]
    assert pitching.getpixel(cell(np.array([0, 1, 0]))) == pitching.getpixel(cell(np.array([0, -1, 0]))) == bright
    theta, phi = np.radians(95), np.radians(-20)  # on the upper edge of the region
    edge = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])
    assert own.getpixel(cell(edge)) == (17, 17, 17)


def test_bands_double_and_reach_the_densest_direction():
    assert bands_to(77.0).edges == (5, 10, 20, 40)
    edges = bands_to(3000.0).edges
    assert edges == (80, 160, 320, 640, 1280, 2560) and bands_to(0.0).edges == (5,)
    bands = bands_to(3000.0)
    np.testing.assert_allclose(bands([0, 79.9, 80, 2559, 2560, 1e5]), np.array([0, 0, 1, 5, 6, 6]) / 6)
    assert [word for _, word in bands.key()] == ["<80", "80", "160", "320", "640", "1280", "2560"]


def test_a_check_knows_its_bodies():
    names = ["alignment_linkage", "base_mount", "lidar_body", "lidar_cap", "ring_rotor", "servo_case", "servo_horn"]
    turning = {"alignment_linkage", "lidar_body", "lidar_cap", "ring_rotor", "servo_horn"}
    bodies = {name: PlacedBody(build_scene(np.eye(3)[None]), name in turning) for name in [*names, "servo_shaft"]}
    bought = {"UTM-30LX": "lidar", "MX-64R": "servo", "SNU11": "slip ring"}
    for where, expected in {
        "base_mount": {"base_mount"},
        "servo_shaft and ring_rotor": {"servo_shaft", "ring_rotor"},
        "servo": {"servo_case", "servo_horn"},
        "MX-64R": {"servo_case", "servo_horn"},
        "SNU11": {"ring_rotor"},
        "UTM-30LX": {"lidar_body", "lidar_cap"},
        "rotor": turning,
        "fdm-0.4": set(),
        "": set(),
    }.items():
        assert set(bodies_named("wall", where, bodies, bought)) == expected, where
    assert bodies_named("beams_hidden", "beams at -3.00 to 4.50 deg", bodies, bought) == ("lidar_body", "lidar_cap")


def test_the_picture_of_a_check_is_dark_where_its_body_is(folder):
    bodies = placed_bodies(load_glb(folder / "assembly.glb"))
    pictures = CheckPictures(bodies)
    yaw, pitch = np.radians(40), np.radians(22)
    right = np.array([-np.sin(yaw), np.cos(yaw), 0])
    up = np.array([-np.cos(yaw) * np.sin(pitch), -np.sin(yaw) * np.sin(pitch), np.cos(pitch)])
    for name, body in bodies.items():
        shot = np.asarray(picture(pictures.picture((name,))), float)
        named = shot[:, :, 0] - shot[:, :, 2] > 60
        rows, columns = np.nonzero(named)
        every = np.concatenate([b.scene.triangles_m.reshape(-1, 3) for b in bodies.values()])
        own = body.scene.triangles_m.reshape(-1, 3)
        for axis, pixels, size, sign in ((right, columns, 200, 1), (up, rows, 150, -1)):
            whole, part = every @ axis, own @ axis
            pixel = max(np.ptp(every @ right) / 200, np.ptp(every @ up) / 150) * 1.04
            centre = size / 2 + sign * ((part.min() + part.max()) - (whole.min() + whole.max())) / 2 / pixel
            assert (pixels.min() + pixels.max() + 1) / 2 == pytest.approx(centre, abs=2)
            assert np.ptp(pixels) + 1 == pytest.approx(np.ptp(part) / pixel, abs=3)
