"""Occupancy grids of simulated rooms whose walls and shadows are known, and the files as a map_server reads them."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy.ndimage import binary_dilation

from scanwright.design.errors import RecordingError
from scanwright.design.scene.ray_caster import build_scene, cast
from scanwright.firmware_io.emulators.world import furnished_room
from scanwright.firmware_io.mapping.map_files import find_floor, write_map
from scanwright.firmware_io.mapping.occupancy import FREE, OCCUPIED, UNKNOWN, Heights, occupancy_grid

CELL_M = 0.05
HEIGHTS = Heights(-0.9)
LOW, HIGH = np.array([-2.025, -1.525, -0.9]), np.array([2.025, 1.525, 1.6])  # walls in the middle of cells
NEAR, FAR, HALF = 0.775, 1.175, 0.275  # a pillar across the x axis, up to the ceiling


def seen(triangles, eye, count=120_000, noise_m=0.005, seed=1):
    """What a scanner at `eye` sees of a scene all around, a golden spiral of beams: points of shape (n, 3)."""
    k = np.arange(count) + 0.5
    z, turn = 1 - 2 * k / count, np.pi * (1 + 5**0.5) * k
    along = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1)
    ranges = cast(build_scene(triangles, "room"), np.tile(np.asarray(eye, float), (count, 1)), along).range_m
    return eye + along * (ranges + np.random.default_rng(seed).normal(0, noise_m, count))[:, None]


def boxes(*bounds):
    return np.concatenate([trimesh.creation.box(bounds=bound).triangles for bound in bounds])


@pytest.fixture(scope="module")
def with_pillar():
    points = seen(boxes([LOW, HIGH], [[NEAR, -HALF, -0.9], [FAR, HALF, 1.6]]), np.zeros(3))
    return occupancy_grid(points, np.zeros_like(points), HEIGHTS, CELL_M)


def middles(grid):
    """x and y of the middle of every cell, in the shape of the cells."""
    rows, columns = grid.cells.shape
    return np.meshgrid(
        *(o + (np.arange(n) + 0.5) * grid.resolution_m for o, n in zip(grid.origin_m, (columns, rows), strict=True))
    )


def test_walls_are_where_they_stand_and_what_a_pillar_hides_is_unknown(with_pillar):
    x, y = middles(with_pillar)
    inside = (np.abs(x) < HIGH[0] - CELL_M / 2) & (np.abs(y) < HIGH[1] - CELL_M / 2)
    wall = (np.abs(x) < HIGH[0] + CELL_M / 2) & (np.abs(y) < HIGH[1] + CELL_M / 2) & ~inside
    pillar = (x > NEAR - CELL_M / 2) & (x < FAR + CELL_M / 2) & (np.abs(y) < HALF + CELL_M / 2)
    hidden = (x > NEAR + CELL_M) & (np.abs(y) < HALF * (x - CELL_M) / NEAR - CELL_M)
    occupied = with_pillar.cells == OCCUPIED
    assert binary_dilation(occupied, np.ones((3, 3)))[wall & ~hidden].all()
    assert occupied[wall & ~hidden].mean() > 0.97
    assert not occupied[inside & ~pillar].any()
    assert (with_pillar.cells[hidden & inside] == UNKNOWN).all()
    assert (with_pillar.cells[~inside] != FREE).all()


def test_areas_are_those_of_the_closed_form(with_pillar):
    # from the origin the pillar hides |y| < HALF x / NEAR from its face to the wall
    hidden_m2 = HALF / NEAR * (HIGH[0] ** 2 - NEAR**2)
    room_m2 = np.prod(HIGH[:2] - LOW[:2])
    edge_m = 2 * np.sum(HIGH[:2] - LOW[:2]) + 2 * HALF + 2 * (HIGH[0] - NEAR) * np.hypot(1, HALF / NEAR)
    known_m2 = with_pillar.area_m2(FREE) + with_pillar.area_m2(OCCUPIED)
    assert abs(known_m2 - (room_m2 - hidden_m2)) < edge_m * CELL_M  # a cell on either side of all edges, at most
    faces_m = 2 * np.sum(HIGH[:2] - LOW[:2]) - 2 * HALF * HIGH[0] / NEAR + 2 * HALF
    assert with_pillar.area_m2(OCCUPIED) == pytest.approx(faces_m * CELL_M, rel=0.05)


def test_a_furnished_room_has_its_obstacles_and_nothing_free_behind_its_walls():
    points = seen(furnished_room(), np.zeros(3), noise_m=0.01)
    grid = occupancy_grid(points, np.zeros_like(points), HEIGHTS, CELL_M)
    x, y = middles(grid)
    outside = np.max([-3.2 - x, x - 4.0, -2.4 - y, y - 3.2], axis=0)
    assert (grid.cells[outside > CELL_M / 2] != FREE).all()
    assert (grid.cells[outside > 1.5 * CELL_M] != OCCUPIED).all()
    inner = {"table": [1.7, 2.9, -2.3, -1.7], "cupboard": [3.4, 3.45, 0.5, 1.9], "bench": [-3.1, -2.6, -1.5, -0.3]}
    for name, (left, right, near, far) in inner.items():
        there = (x > left) & (x < right) & (y > near) & (y < far)
        assert (grid.cells[there] != FREE).all(), name
        assert (grid.cells[there] == OCCUPIED).any(), name
    lamp = (x > 0.5) & (x < 1.5) & (np.abs(y) < 0.3)  # it hangs 2.5 m above the floor
    assert (grid.cells[lamp] == FREE).mean() > 0.99


def test_every_cell_of_a_way_is_one_that_the_way_is_in():
    rng = np.random.default_rng(4)
    eyes = rng.uniform(-3, 3, (30, 3)) * [1, 1, 0]
    points = rng.uniform(-3, 3, (30, 3)) * [1, 1, 0]
    points[:4, 0] = eyes[:4, 0]  # along an axis
    for eye, point in zip(eyes, points, strict=True):
        grid = occupancy_grid(point[None], eye[None], Heights(-0.05, 0.1), 0.1)
        until = 1 - 0.05 / np.linalg.norm(point - eye)  # half the lower height is not believed
        on_way = (eye + np.linspace(0, until, 20_000)[:, None] * (point - eye))[:, :2]
        column, row = np.floor((on_way - grid.origin_m) / 0.1 + 1e-9).astype(int).T
        expected = np.full_like(grid.cells, UNKNOWN)
        expected[row, column] = FREE
        assert (grid.cells != expected).sum() <= 1  # where it all but touches a corner


def test_points_that_nobody_knows_the_eye_of_free_nothing():
    points = seen(boxes([LOW, HIGH]), np.zeros(3), 20_000)
    grid = occupancy_grid(points, np.full_like(points, np.nan), HEIGHTS, CELL_M)
    assert grid.area_m2(FREE) == 0
    assert grid.area_m2(OCCUPIED) > 0


def test_a_map_server_reads_the_cells_that_were_meant(tmp_path, with_pillar):
    cells = with_pillar.cells.copy()
    cells[0, 1] = OCCUPIED  # as above the x axis so below it, else
    grid = replace(with_pillar, cells=cells)
    yaml, image = write_map(tmp_path / 'a "room".yaml', grid)
    told = dict(line.split(": ", 1) for line in yaml.read_text().splitlines())
    assert told["image"] == '"a \\"room\\".pgm"'
    pixels = np.asarray(Image.open(image)).astype(float)
    occupied = (255 - pixels) / 255  # negate is 0
    read = np.full(pixels.shape, UNKNOWN)
    read[occupied > float(told["occupied_thresh"])] = OCCUPIED
    read[occupied < float(told["free_thresh"])] = FREE
    np.testing.assert_array_equal(read[::-1], cells)  # the first row of the image is the top
    x, y, yaw = (float(value) for value in told["origin"].strip("[]").split(","))
    np.testing.assert_allclose([x, y, yaw], [*with_pillar.origin_m, 0], atol=1e-6)
    assert (x, float(told["resolution"])) == (pytest.approx(-2.1), 0.05)


@pytest.mark.parametrize("eye_z", [-0.5, 0.3])
def test_the_floor_is_found_under_furniture(eye_z):
    points = seen(furnished_room(), np.array([0.1, 0.2, eye_z]), noise_m=0.01)
    assert find_floor(points) == pytest.approx(-0.9, abs=1e-3)


def test_where_there_is_no_floor_a_line_says_why():
    room = seen(boxes([LOW, HIGH]), np.zeros(3), 20_000)
    with pytest.raises(RecordingError, match=r"what lies lowest shares no level: 0 m2 at z = 0\.00 m.*floor_m"):
        find_floor(room[np.abs(room[:, 2]) < 0.02] * [1, 1, 0])  # a fan that lies level
    with pytest.raises(RecordingError, match=r"% of the points lie below the widest level, z = 1\.[56]"):
        find_floor(room[room[:, 2] > 0])
    with pytest.raises(RecordingError, match="no point lies below the scanner"):
        find_floor(room[room[:, 2] > 0.1], below_m=0.0)
    tilt = np.radians(3)
    tilted = room @ np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    with pytest.raises(RecordingError, match=r"tilted by [23]\.\d deg, at most 1"):
        find_floor(tilted)


def test_a_grid_that_no_computer_holds_is_refused():
    points = np.array([[0.0, 0, 0], [1e7, 0, 0]])
    with pytest.raises(RecordingError, match=r"resolution_m = 0\.05: 200,000,003 x 3 cells") as told:
        occupancy_grid(points, np.full_like(points, np.nan), HEIGHTS, CELL_M)
    assert "\n" not in str(told.value)
    with pytest.raises(RecordingError, match=r"no point and no beam between 0\.1 and 1\.8 m above the floor"):
        occupancy_grid(points, np.full_like(points, np.nan), Heights(50.0), CELL_M)
