"""`scanwright new`: tasks that load, what cannot work together, and the questions of a terminal."""

import os
import pty
import re
import select
import shlex
import subprocess
import sys
import time

import numpy as np
import pytest

from scanwright.cad.layout.placement import placement_of
from scanwright.design.angles import AngleSet
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.servo import Servo
from scanwright.design.errors import TaskError
from scanwright.design.task.shapes import AllRegion, BandRegion, CeilingRegion, GroundRegion, WallRegion
from scanwright.design.task.task import load_task
from scanwright.pipeline.deck_height import deck_height
from scanwright.pipeline.new_task import ANGLES, UPRIGHT, Answers, task_text, write_task_file
from scanwright.pipeline.robot_around import robot_around
from scanwright.pipeline.seen_regions import SEEN

PATIENCE_S = 60.0  # ten times what it takes on a computer that has much else to do
PRODUCTS = load_catalogue()
LIDARS, SERVOS = ([p.name for p in PRODUCTS if isinstance(p, kind)] for kind in (Lidar, Servo))
DOG = ["--lidar", "UST-20LX", "--servo", "XM430-W350", "--height-m", "0.4", "--see", "ground:0.5:5", "--see", "ceiling"]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("servo", SERVOS)
@pytest.mark.parametrize("lidar", LIDARS)
def test_every_pair_is_a_task_without_a_warning_or_one_line_says_why_not(here, lidar, servo):
    try:
        text = task_text(Answers("pair", lidar, servo, 0.5, ("ground",), 10.0), PRODUCTS, "new", here / "pair.toml")
    except TaskError as error:
        assert f"{lidar} on {servo}: these cannot work together: " in str(error)
        assert "\n" not in str(error)
        heavy = PRODUCTS.get(lidar, Lidar).mass_g > 1000
        weak = servo.startswith("X") or servo in ("AX-12A", "STS3215")
        assert (heavy and weak) or lidar in (
            "LD06",
            "LMS511",
        )  # no two equal holes in one face; its M8 screws would hide its window
    else:
        warnings = write_task_file(here / "pair.toml", text)
        near = PRODUCTS.get(lidar, Lidar).practical_range_m < 5.0  # where the ground of the task ends
        assert [f"that {lidar} sees" in warning for warning in warnings] == [True] * near


def test_every_line_of_the_drawn_angles_passes_through_its_lidar():
    lines = ANGLES.splitlines()
    (middle,) = (i for i, line in enumerate(lines) if "-----L----->" in line)
    lidars = [i for i, sign in enumerate(lines[middle]) if sign == "L"]
    assert len(lidars) == 5
    for below in (-2, -1, 1, 2):
        for place, sign in enumerate(lines[middle + below][1:], 1):
            if sign in "|/\\":
                aside = {"|": 0, "/": -below, "\\": below}[sign]
                assert place - aside in lidars, (below, place, sign)


def test_what_was_asked_for_stands_in_the_file(command, here):
    code, out, complaints = command("new", "dog", *DOG, "-o", "FILE.toml")
    assert (code, out) == (0, "wrote FILE.toml\n")
    assert complaints == ["next: `scanwright build FILE.toml` (or `scanwright optimise FILE.toml` for the angles only)"]
    text = (here / "FILE.toml").read_text()
    assert ANGLES in text
    task = load_task(here / "FILE.toml").task
    ground, ceiling = task.weight
    assert isinstance(ground, GroundRegion) and isinstance(ceiling, CeilingRegion)
    assert (ground.from_m, ground.to_m, ground.height_m, ceiling.ceiling_m) == (0.5, 5, 0.4, 2.5)
    assert (task.sensor, task.servo, task.slip_ring) == ("UST-20LX", "XM430-W350", None)
    assert "a slip ring does not fit XM430-W350, or needs a printed frame around it: it sweeps back and forth" in text
    again = next(line for line in text.splitlines() if line.startswith("# Made by: ")).removeprefix("# Made by: ")
    (here / "FILE.toml").unlink()
    assert command(*shlex.split(again)[1:])[0] == 0
    assert (here / "FILE.toml").read_text() == text


def test_flat_ground_gets_a_smaller_ball(command, here):
    """J counts ground within the ball radius of a beam as seen: far away that may be a metre."""
    for far_m, ball_deg in ((1, 2.0), (4, 1.1), (20, 0.5)):
        assert command("new", "flat", *DOG[:4], "--height-m", "0.45", "--see", f"ground:0.5:{far_m}")[0] == 0
        assert load_task(here / "flat.toml").task.density.ball_radius_deg == ball_deg
        (here / "flat.toml").unlink()


def test_every_thing_that_can_be_seen_and_a_robot_below(command, here):
    words = [word for each in SEEN for word in ("--see", each)]
    box = ["--robot", "box:0.6:0.3:0.3", "--ahead-m", "0.2"]
    assert command("new", "all_of_it", *DOG[:6], *words, *box, "--scan-s", "20")[0] == 0
    task = load_task(here / "all_of_it.toml").task
    # the last region decides where they overlap
    assert [type(r) for r in task.weight] == [AllRegion, BandRegion, GroundRegion, CeilingRegion, WallRegion]
    assert task.weight[1].theta_deg == (60, 120)
    assert task.density.ball_radius_deg == pytest.approx(0.95, abs=0.01)  # 0.05 m at 3 m
    top = task.mask[0]
    assert top.corners_m()[0] == pytest.approx((-0.5, -0.15, -0.1)) and top.corners_m()[2] == pytest.approx(
        (0.1, 0.15, -0.1)
    )
    assert task.motion.period_s == 20


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (["--see", "grund"], "did you mean 'ground'?"),
        (["--see", "ground:a"], "--see = 'ground:a': needs numbers after the colons"),
        (["--see", "ceiling:1:2"], "at most 1 finite numbers"),
        (["--see", "ceiling:0.2"], "ceiling_m = 0.2 is not above --height-m = 0.4"),
        (["--see", "thing:0:3"], "size and distance must be above 0"),
        (["--see", "thing:0.001:100"], "error: --see = 'thing:0.001:100': appears 0.00057 deg wide, minimum 0.02"),
        (
            ["--see", "wall:0:0"],
            "error: --see = 'wall:0:0:0:2.5': distance_m = 0: Input should be greater than or equal",
        ),
        (["--height-m", "-1"], "error: --height-m = -1: must be between 0.001 and 10000 m"),
        (
            ["--height-m", "45"],
            "--height-m = 45: UST-20LX sees 20 m and would not reach the ground; use metres (45 cm is 0.45, "
            "45 mm is 0.045)",
        ),
        (["--height-m", "-1", "--see", "all"], "--height-m = -1: must be"),
        (["--lidar", "UST10"], "did you mean 'UST-10LX'?"),
        (["--robot", "box:1"], "box:LENGTH:WIDTH:HEIGHT"),
        (["--robot", "box:1:1:0.5"], "is not above it"),
        (["--robot", "box:1:1:-0.5"], "--robot = 'box:1:1:-0.5': HEIGHT is positive: box:1:1:0.5"),
        (["--robot", "box:-1:1:0.5"], "LENGTH is positive: box:1:1:0.5"),
        (["--robot", "box.stl"], "box.stl: no such file"),
        (["--see", "around:60:-45"], "--see = 'around:60:-45': DOWN is positive: around:60:45"),
        (["--see", "around:-5"], "UP is positive: around:5"),
        (["--see", "around:0:-45"], "DOWN is positive: around:0:45"),
        (["--see", "wall:-2:1:-90"], "DISTANCE is positive: wall:2:1:-90"),
        (["--see", "ground:-2:-1:-4"], "WIDTH is positive: ground:-2:-1:4"),
        (["--see", "ceiling:-2"], "HEIGHT is positive: ceiling:2"),
        (["--see", "thing:-0.1:3"], "SIZE is positive: thing:0.1:3"),
        (["--robot", "none.stl"], "none.stl: no such file"),
        (["--scan-s", "0.1"], "take 2 s at least"),
        (["--scan-s", "-1"], "motion.period_s = -1"),
    ],
)
def test_an_answer_that_makes_no_sense_is_one_line_and_no_file(command, here, change, told):
    code, _, complaints = command("new", "dog", *DOG, *change)
    assert (code, len(complaints)) == (2, 1)
    assert told in complaints[0]
    assert ".toml:" not in complaints[0]  # no line of a file that is not there
    assert not list(here.iterdir())


def test_a_file_is_never_written_over_and_nobody_is_asked_where_nobody_is(command, here):
    (here / "dog.toml").write_text("mine")
    assert "dog.toml: exists; choose" in command("new", "dog", *DOG)[2][0]
    assert (here / "dog.toml").read_text() == "mine"
    assert "missing options --servo, --height-m, --see" in command("new", "cat", "--lidar", "UST-10LX")[2][0]
    assert "'LD20' is no lidar of the catalogue" in command("new", "cat", "--lidar", "LD20")[2][0]


QUESTIONS = [
    ("Which lidar?", "ust"),
    ("'ust' is more than one: UST-10LX, UST-20LX", "ust10"),
    ("did you mean 'UST-10LX'?", "ust-10"),
    ("How many metres", "sixty"),
    ("'sixty' is not a number", "0.6"),
    ("blocks the view", "box:1:1:0.9"),
    ("is not above it", "box:1:1:0.3"),
    ("ahead of the middle of the box", "0.9"),
    ("is not above it", "0.2"),
    ("must it see", "ground from 0.5 to 5"),
    ("'from': unknown region", "wall:2 around"),
    ("How many seconds", "0.1"),
    ("rpm at most", ""),
]


def test_walls_to_the_sides_have_a_heading_and_a_top(command, here):
    walls = [word for side in (90, -90) for word in ("--see", f"wall:1:2:{side}:0.5")]
    assert command("new", "sides", *DOG, *walls)[0] == 0
    regions = [region for region in load_task(here / "sides.toml").task.weight if region.shape == "wall"]
    assert [(r.distance_m, r.width_m, r.heading_deg, r.top_m) for r in regions] == [(1, 2, 90, 0.5), (1, 2, -90, 0.5)]


@pytest.mark.parametrize(("key", "code"), [(b"\x04", 2), (b"\x03", 130)])
def test_the_end_of_the_input_at_a_question_is_one_line(here, key, code):
    screen, keyboard = pty.openpty()
    words = [sys.executable, "-m", "scanwright", "new", "ended", "--lidar", "LD19", "--servo", "MX-28"]
    take = "import fcntl, os, termios; os.setsid(); fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
    program = subprocess.Popen(
        [sys.executable, "-c", f"{take}os.execv({words[0]!r}, {words!r})"],
        stdin=keyboard,
        stdout=keyboard,
        stderr=keyboard,
    )
    os.close(keyboard)
    said = b""
    try:
        while not said.endswith(b" > "):
            assert select.select([screen], [], [], PATIENCE_S)[0], said
            said += os.read(screen, 4096)
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            os.write(screen, key)  # again if readline lost it: a signal just before it waits does not wake it
            while select.select([screen], [], [], 2)[0]:
                try:
                    said += os.read(screen, 4096)
                except OSError:  # the program closed the terminal
                    break
            if program.poll() is not None:
                break
        assert program.poll() == code, said
    finally:
        program.kill()
        program.wait()
        os.close(screen)
    assert b"Traceback" not in said and (b"no answer: the input ended" in said) == (code == 2)
    assert not list(here.iterdir())


def test_on_a_terminal_what_no_flag_answers_is_asked(here):
    """A terminal of its own; a name that is wrong is asked for again, one in small letters is understood."""
    screen, keyboard = pty.openpty()
    words = [sys.executable, "-m", "scanwright", "new", "asked", "--servo", "MX-28"]
    program = subprocess.Popen(words, stdin=keyboard, stdout=keyboard, stderr=keyboard, start_new_session=True)
    os.close(keyboard)
    try:
        for question, answer in QUESTIONS:
            said = ""
            while question not in said or not said.endswith(" > "):
                assert select.select([screen], [], [], PATIENCE_S)[0], f"not asked: {question!r}, but {said!r}"
                said += os.read(screen, 4096).decode()
            os.write(screen, f"{answer}\n".encode())
        assert program.wait(PATIENCE_S) == 0
    finally:
        program.kill()
        os.close(screen)
    task = load_task(here / "asked.toml").task
    assert (task.sensor, task.weight[1].distance_m, task.weight[0].shape) == ("UST-10LX", 2, "band")
    assert (task.mask[0].from_m, task.mask[0].to_m) == (-0.7, 0.3)


@pytest.mark.parametrize("roof", [False, True], ids=["open deck", "below a roof"])
def test_a_scanner_hangs_only_below_a_part_of_the_robot_mesh(command, here, roof):
    import trimesh

    deck = trimesh.creation.box((0.6, 0.3, 0.1), trimesh.transformations.translation_matrix((0, 0, 0.25)))
    top = trimesh.creation.box((0.3, 0.3, 0.02), trimesh.transformations.translation_matrix((0, 0, 0.9)))
    (trimesh.util.concatenate([deck, top]) if roof else deck).export(here / "robot.stl")
    assert command("new", "dog", *DOG, "--robot", "robot.stl")[0] == 0
    loaded = load_task(here / "dog.toml")
    assert loaded.task.angles.alpha_rot_deg == ((-180, 180) if roof else (-90, 90))
    assert robot_around(loaded.task.mask, here) == (pytest.approx(0.1), pytest.approx(0.49) if roof else float("inf"))


@pytest.mark.parametrize("seed", range(3))
def test_a_scanner_lower_over_its_robot_than_it_can_be_built_is_told_before_the_build(command, here, seed):
    """The height that the warning names is enough, and its deck is then where the task has it."""
    rng = np.random.default_rng(seed)
    lidar, servo = rng.choice(["LD19", "UST-10LX", "URG-04LX"]), rng.choice(["XL430-W250", "MX-64R"])
    tall_m, over_m = round(rng.uniform(0.1, 1.0), 2), round(rng.uniform(0.01, 0.06), 3)
    words = ["--lidar", lidar, "--servo", servo, "--see", "ground:1:3", "--robot", f"box:0.6:0.4:{tall_m}"]
    code, _, (warning, _) = command("new", "low", *words, "--height-m", round(tall_m + over_m, 3))
    assert code == 0 and warning.startswith("warning: the scanner is ")
    larger_m = float(re.search(r"use a --height-m that is ([\d.]+) m larger", warning)[1])
    code, _, complaints = command("new", "high", *words, "--height-m", round(tall_m + over_m + larger_m, 3))
    assert code == 0 and len(complaints) == 1

    loaded = load_task(here / "high.toml")
    task = loaded.task
    angles = AngleSet(task="high", angles_deg=UPRIGHT, sensor=task.sensor, servo=task.servo, slip_ring=task.slip_ring)
    placed = angles.model_copy(update={"t_world_rot_mm": placement_of(loaded.scanner(angles)).deck.t_world_rot})
    assert deck_height(loaded, placed).severity == "note"
    for off_mm, change in ((40, "add 0.0"), (-40, "subtract 0.0")):
        x, y, z = placed.t_world_rot_mm
        off = deck_height(loaded, placed.model_copy(update={"t_world_rot_mm": (x, y, z + off_mm)}))
        assert off.severity == "warning" and off.hint.startswith(change)
