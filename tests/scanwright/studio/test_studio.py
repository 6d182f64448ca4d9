"""What the studio makes of a task, without a page: paint, files, facts, and work that follows a hand."""

import io
import math
import os
import re
import threading
import time
from base64 import b64decode
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from scanwright.design.errors import BuildError, TaskError
from scanwright.design.evaluation.metres import on_planes
from scanwright.design.objective.problem import problem_of
from scanwright.design.objective.score import score
from scanwright.design.sphere.directions import spiral
from scanwright.design.task.task import Limits, load_task
from scanwright.firmware_io.emulators.world import furnished_room
from scanwright.report.room import MOST_RAYS, one_scan
from scanwright.serving.page_server import guarded_server
from scanwright.studio.history import JOINED_S, History, PageState
from scanwright.studio.panel import panel_html
from scanwright.studio.panel.facts import Judge
from scanwright.studio.panel.kept_settings import KeptSettings
from scanwright.studio.panel.pads import pads_html
from scanwright.studio.state import MOST_DABS, Dab, Setting, painted
from scanwright.studio.task_file import save_task, task_text
from scanwright.studio.view import workers
from scanwright.studio.view.latest_only import LatestOnly
from scanwright.studio.view.outlines import edges
from scanwright.studio.view.scanner_bodies import BodyMesh
from scanwright.studio.view.view_3d import GHOST, View3D
from scanwright.studio.view.workers import Order, Workers

SETTING = Setting((0.0, -55.0, -80.0, 75.0))


@pytest.fixture
def loaded(tmp_path, small_task):
    path = tmp_path / "small.toml"
    path.write_text(small_task)
    return load_task(path)


def test_the_last_dab_that_holds_a_direction_wins_as_in_a_task_file(loaded):
    dabs = (
        Dab((0.0, 0.0, 1.0), 30.0, "matters", 3.0),
        Dab((0.0, 0.0, 1.0), 10.0, "does not matter"),
        Dab((0.0, 1.0, 0.0), 15.0, "hidden"),
    )
    field = problem_of(painted(loaded, dabs)).field
    directions = spiral(5000)
    slow = []
    for n in directions:
        weight = 1.0 if n @ np.array([1, 0, -1]) / 2**0.5 >= math.cos(math.radians(40)) else 0.0
        for dab in dabs[:2]:
            if n @ np.array(dab.direction) >= math.cos(math.radians(dab.radius_deg)):
                weight = dab.value if dab.brush == "matters" else 0.0
        hidden = n[1] >= math.cos(math.radians(15)) or -n[0] >= math.cos(math.radians(20))
        slow.append(0.0 if hidden else weight)
    np.testing.assert_array_equal(field.weight_at(directions), slow)


def test_too_much_paint_or_paint_on_everything_is_refused(loaded):
    with pytest.raises(TaskError, match=f"{MOST_DABS} at most"):
        painted(loaded, (Dab((1.0, 0.0, 0.0), 5.0, "matters"),) * (MOST_DABS + 1))
    with pytest.raises(TaskError, match="axis"):
        painted(loaded, (Dab((0.0, 0.0, 0.0), 5.0, "matters"),))
    with pytest.raises(TaskError, match="the region is empty"):
        problem_of(painted(loaded, (Dab((1.0, 0.0, -1.0), 60.0, "hidden"),)))


@settings(max_examples=15, deadline=None)
@given(
    x=st.floats(-1, 1), y=st.floats(-1, 1), radius=st.floats(1, 60), value=st.floats(0.01, 1000),
    angles=st.tuples(st.floats(-180, 180), st.floats(-90, 90), st.floats(-90, 90), st.floats(-90, 90)),
)  # fmt: skip
def test_a_saved_task_reads_back_as_what_was_on_the_page(tmp_path_factory, small_task, x, y, radius, value, angles):
    folder = tmp_path_factory.mktemp("saved")
    (folder / "small.toml").write_text(small_task)
    now = painted(load_task(folder / "small.toml"), (Dab((x, y, 1.0), radius, "matters", value),))
    setting = Setting.within_bounds(angles)
    again = load_task(save_task(now, folder, "mine", setting, overwrite=False))
    fixed = [again.task.angles.limits(name) for name in ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")]
    assert fixed == [(angle, angle) for angle in setting.angles_deg]
    assert again.task.weight == now.task.weight and again.task.mask == now.task.mask
    assert again.task.motion == now.task.motion and again.task.density == now.task.density


def test_saved_elsewhere_a_task_still_finds_its_files(tmp_path, small_task):
    np.save(tmp_path / "map.npy", np.ones((4, 8)))
    source = tmp_path / "mapped.toml"
    source.write_text(small_task + '[[weight]]\nshape = "map"\nfile = "map.npy"\n')
    (tmp_path / "elsewhere").mkdir()
    saved = save_task(load_task(source), tmp_path / "elsewhere", "mine", None, overwrite=False)
    np.testing.assert_array_equal(load_task(saved).maps[0], np.ones((4, 8)))


@pytest.mark.parametrize(
    "name", ["../out", "a/b", "a\\b", "/tmp/x", "", ".", "..", "-x", "x" * 65, "a b", "a\0b", "a.b"]
)
def test_a_name_that_leads_elsewhere_writes_nothing(loaded, tmp_path, name):
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(TaskError):
        save_task(loaded, tmp_path, name, None, overwrite=True)
    assert sorted(tmp_path.rglob("*")) == before


def test_a_file_is_overwritten_only_when_asked_and_a_link_never(loaded, tmp_path):
    save_task(loaded, tmp_path, "mine", None, overwrite=False)
    with pytest.raises(TaskError, match="exists; tick 'overwrite'"):
        save_task(loaded, tmp_path, "mine", SETTING, overwrite=False)
    assert "alpha_rot_deg" not in (tmp_path / "mine.toml").read_text()
    save_task(loaded, tmp_path, "mine", SETTING, overwrite=True)
    assert "alpha_rot_deg = 0.0" in (tmp_path / "mine.toml").read_text()
    (tmp_path / "victim").write_text("keep me")
    (tmp_path / "link.toml").symlink_to(tmp_path / "victim")
    with pytest.raises(TaskError, match="a symbolic link"):
        save_task(loaded, tmp_path, "link", None, overwrite=True)
    assert (tmp_path / "victim").read_text() == "keep me"


def test_every_shipped_task_can_be_saved(tmp_path):
    for name in ("uniform", "indoor_urg", "ceiling"):
        shipped = load_task(Path(name))
        (tmp_path / f"{name}.toml").write_text(task_text(shipped, tmp_path, name, None))
        assert load_task(tmp_path / f"{name}.toml").task == shipped.task


def test_facts_at_rest_are_those_of_score_and_while_dragging_within_their_error(loaded):
    problem = problem_of(loaded)
    judge = Judge.for_task(loaded)
    truth = score(problem, SETTING.angles_rad)
    exact, quick = judge.exact(SETTING), judge.quick(SETTING)
    assert (exact.J, exact.J_error, exact.exact) == (truth.J, truth.J_error, True)
    assert not quick.exact and abs(quick.J - truth.J) <= quick.J_error + truth.J_error
    assert f"{truth.J:.5f}" in panel_html.facts_html(exact)
    assert panel_html.facts_html(exact).count("without parts") == 1
    assert exact.gap_mm == pytest.approx(math.radians(exact.gap_deg) * 10_000)


def test_what_a_scan_leaves_on_the_ground_is_told_in_metres_when_the_hand_rests(tmp_path, small_task):
    ground = '[[weight]]\nshape = "ground"\nfrom_m = 0.5\nto_m = 5\nwidth_m = 4\nheight_m = 0.4\n'
    (tmp_path / "ground.toml").write_text(small_task + ground)
    on_ground = load_task(tmp_path / "ground.toml")
    judge = Judge.for_task(on_ground)
    (figures,) = on_planes(on_ground, judge.problem, SETTING.angles_rad)
    dragged = panel_html.facts_html(judge.quick(SETTING))
    assert "ground 0.5 to 5 m ahead: ..." in dragged and "points per m2" not in dragged  # no figure of another setting
    assert figures.words() in panel_html.facts_html(judge.settled(judge.exact(SETTING)))


def test_what_was_asked_for_is_ticked_and_ratios_are_against_the_best_usual_mount(loaded):
    limits = Limits(min_density=3, max_line_gap_deg=0.01, max_blind_cone_deg=90)
    judge = Judge.for_task(replace(loaded, task=loaded.task.model_copy(update={"limits": limits})))
    facts = judge.exact(SETTING)
    asked = {words: (met, value) for words, met, value in facts.requirements()}
    assert asked["no blind spot"][0] == (facts.blind_weight < 1e-6)
    assert asked["at least 3 beams per ball"] == (facts.least >= 3, str(facts.least))
    assert asked["scan lines at most 0.01 deg apart"] == (False, f"{facts.gap_deg:.3f} deg")
    assert asked["blind cone at most 90 deg"][0]
    assert "not met" in panel_html.facts_html(facts) and "met" in panel_html.facts_html(facts)
    assert facts.ratio == pytest.approx(math.exp(min(facts.mounts.values()) - facts.J))
    assert f"{facts.ratio:.2f} x" in panel_html.kept_html({"A": facts})
    assert math.isnan(replace(facts, log=False).ratio)


@pytest.mark.parametrize(
    ("text", "words"),
    [("0, 90, 0", "not four numbers"), ("a b c d", "not four"), ("0 91 0 0", "91 deg is out of bounds"), ("", "four")],
)
def test_a_typed_setting_that_is_none_is_one_line(text, words):
    with pytest.raises(TaskError, match=words):
        Setting.read(text)
    assert Setting.read(SETTING.text) == SETTING


def test_edges_lie_on_the_cones_of_the_task(loaded):
    weight, mask = edges(problem_of(loaded).field)
    np.testing.assert_allclose(mask @ np.array([-1.0, 0, 0]), math.cos(math.radians(20)), atol=0.01)
    np.testing.assert_allclose(weight @ np.array([1, 0, -1]) / 2**0.5, math.cos(math.radians(40)), atol=0.012)


def test_of_many_wishes_the_last_is_done_and_then_the_rest():
    gate, begun, done, rested = threading.Event(), threading.Event(), [], []

    def work(wish):
        begun.set()
        gate.wait(10)
        done.append(wish)
        if wish == "bad":
            raise RuntimeError("a fault of one wish")

    newest = LatestOnly("test", work, rested.append, rest_s=0.01)
    newest.request(0)
    assert begun.wait(10)
    for wish in range(1, 50):
        newest.request(wish)
    gate.set()
    assert newest.settled(10)
    assert (done, rested, newest.replaced) == ([0, 49], [49], 48)
    newest.close()


def test_a_slider_that_is_dragged_is_one_step_and_each_stroke_is_one():
    now = PageState((), SETTING, (), (("radius", 12.0),))
    at_s = 0.0
    history = History(now, lambda: at_s)

    def moved(angle):
        return replace(history._done[-1], setting=Setting((0.0, angle, -80.0, 75.0)))

    assert history.undo() is None and history.redo() is None and (history.undoes, history.redoes) == ("", "")
    for angle in (-54.0, -53.0, -50.0):
        at_s += 0.9 * JOINED_S
        history.note(moved(angle), "beta_rot")
    assert history.undoes == "beta_rot -55 to -50"
    at_s += 1.1 * JOINED_S  # the hand had let go
    history.note(moved(-40.0), "beta_rot")
    history.note(replace(history._done[-1], fields=(("radius", 20.0),)), "radius")
    dabs = tuple(Dab((1.0, 0.1 * k, 0.0), 5.0, "matters") for k in range(5))
    for count, stroke in ((1, 1), (2, 1), (3, 2), (5, 2)):
        at_s += 100 * JOINED_S
        history.note(replace(history._done[-1], dabs=dabs[:count]), ("stroke", stroke), math.inf)
    history.note(replace(history._done[-1], dabs=()), None)
    said = []
    while history.undoes:
        said.append(history.undoes)
        undone = history.undo()
    assert undone == now and said == [
        "clear paint",
        "paint 3 dabs",
        "paint 2 dabs",
        "radius 12 to 20",
        "beta_rot -50 to -40",
        "beta_rot -55 to -50",
    ]
    assert history.redo().setting == Setting((0.0, -50.0, -80.0, 75.0)) and history.redoes == "beta_rot -50 to -40"
    history.note(moved(-50.0), "beta_rot")  # nothing has changed: what was undone is still there
    assert history.redoes
    history.note(moved(10.0), "beta_rot")
    assert not history.redoes and history.redo() is None
    history.note(moved(-50.0), "beta_rot")  # back where it was, in one drag
    assert history.undoes == "beta_rot -55 to -50"


def bodies(scanner, turning):
    """A stand-in for the kernel: a triangle as large as beta_rot, none at beta_laser = 13; what stands waits."""
    if scanner.angles.angles_deg.beta_laser == 13:
        raise BuildError("alignment_linkage: no room")
    while not turning and not Path(os.environ["SCANWRIGHT_TEST_GO"]).exists():
        time.sleep(0.01)
    corners = np.eye(3, dtype=np.float32) * np.float32(scanner.angles.angles_deg.beta_rot)
    return (BodyMesh("turning" if turning else "standing", corners, np.array([[0, 1, 2]], np.uint32), (1, 2, 3)),)


def points(_scanner, joint_rad, _placed, _folder):
    return np.zeros((len(joint_rad), 3), np.float32)


def test_parts_and_scans_are_made_side_by_side_and_a_refusal_is_said(loaded, tmp_path, monkeypatch):
    monkeypatch.setenv("SCANWRIGHT_TEST_GO", str(tmp_path / "go"))
    monkeypatch.setattr(workers, "make_bodies", bodies)
    monkeypatch.setattr(workers, "one_scan", points)
    shown, said, faded = {}, [], []
    problem = problem_of(loaded)

    class View:
        def fade_bodies(self, turning):
            faded.append((turning, shown.get(turning)))

        def show_bodies(self, _, turning, made):
            self._show(turning, made[0].vertices_m.max() if made else None)

        def show_points(self, points_m):
            self._show("points", points_m.shape)

        def _show(self, name, value):
            shown[name] = value
            if shown.keys() >= {True, "points"}:  # what turns, and the scan, did not wait for what stands
                (tmp_path / "go").touch()

    all_three = Workers(View(), lambda text, bad: said.append((text, bad)))
    try:
        all_three.order(Order(loaded, problem, Setting((0, 40, 0, 0)), True, "room"))
        assert all_three.settled(60)
        assert shown == {True: 40, False: 40, "points": (80, 3)}
        assert said[-1] == ("", False)
        assert sorted(faded) == [(False, None), (True, None)]
        all_three.order(Order(loaded, problem, Setting((0, 40, 0, 13)), True, ""))
        assert all_three.settled(60)
        assert said[-1] == ("alignment_linkage: no room", True)
        assert sorted(faded[2:]) == [(False, 40), (True, 40)]  # while the new ones are made, the old ones are ghosts
        assert shown[True] is shown[False] is None  # and no other setting's parts stay
        all_three.order(Order(loaded, problem, Setting((0, 40, 0, 0)), True, ""))
        assert all_three.settled(60)
        assert (shown[True], said[-1]) == (40, ("", False))
    finally:
        all_three.close()


def test_parts_of_an_earlier_setting_are_ghosts_until_the_new_ones_stand():
    body = (BodyMesh("box", np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.uint32), (1, 2, 3)),)
    with guarded_server("a page") as (server, _):
        view = View3D(server, load_task(Path("ground_ahead")).task)
        view.show_bodies(SETTING, True, body)
        assert [handle.opacity for handle in view._bodies[True]] == [None]
        view.fade_bodies(True)
        assert [handle.opacity for handle in view._bodies[True]] == [GHOST]
        view.show_bodies(SETTING, True, body)
        assert [handle.opacity for handle in view._bodies[True]] == [None]


def test_the_preview_draws_as_many_points_as_a_page_can_and_stands_on_the_walls_of_the_room(loaded, tmp_path):
    order = Order(loaded, problem_of(loaded), SETTING, True, "room")
    joint_rad = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    seen = one_scan(order.scanner(), joint_rad, None, tmp_path)
    assert 10_000 < len(seen) <= MOST_RAYS
    low, high = furnished_room().reshape(-1, 3).min(axis=0), furnished_room().reshape(-1, 3).max(axis=0)
    assert ((seen > low - 0.2) & (seen < high + 0.2)).all()


def test_what_is_kept_while_the_others_are_judged_again_stays_and_is_judged_by_the_same_task(loaded):
    hidden = painted(loaded, (Dab((1.0, 0.0, -1.0), 20.0, "hidden"),))
    before, after = Judge.for_task(loaded), Judge.for_task(hidden)
    judging, kept_one = threading.Event(), threading.Event()

    class Slow:
        settled, references = staticmethod(after.settled), staticmethod(after.references)

        def exact(self, setting):
            judging.set()
            kept_one.wait(0.5)  # one that waits for this may be kept only after it
            return after.exact(setting)

    controls = SimpleNamespace(table=SimpleNamespace(), kept=SimpleNamespace(value=""))
    kept = KeptSettings(controls, lambda _: None, before)
    thread = threading.Thread(target=kept.rejudge, args=(Slow(),))
    thread.start()
    assert judging.wait(10)
    name = kept.keep(SETTING)
    kept_one.set()
    thread.join(20)
    assert controls.kept.options == (*after.references(), name) and ">A<" in controls.table.content
    assert {"rolling", "pitching", "upright, one tilt"} < set(controls.kept.options) and len(controls.kept.options) == 5
    assert f"{after.exact(SETTING).ratio:.2f} x" in controls.table.content


def test_a_landscape_is_brightest_at_the_best_pair_and_covers_the_range_of_the_task():
    alpha, beta = np.meshgrid(np.arange(-40.0, 41, 10), np.arange(0.0, 91, 10))
    J = -2 + ((alpha - 20) ** 2 + (beta - 60) ** 2) / 1000
    J[0, 0] = np.inf  # no mount there
    rows = np.column_stack([alpha.ravel(), beta.ravel(), J.ravel()])
    search = SimpleNamespace(axes=rows, planes=rows[:1])
    html = pads_html(SimpleNamespace(search=search, problem=SimpleNamespace(objective=SimpleNamespace(name="log"))))
    (png,) = re.findall(r"base64,([^\"]+)", html)
    assert "left:38.9%;top:0.0%;width:22.2%;height:50.0%" in html
    shade = np.asarray(Image.open(io.BytesIO(b64decode(png)))).astype(int).sum(axis=2)
    row, column = np.argwhere(shade == shade.max()).mean(axis=0) / shade.shape
    assert abs(-40 + 80 * column - 20) < 2 and abs(90 - 90 * row - 60) < 2
    assert shade[-1, 0] == shade.min()
    assert pads_html(None).count("sw-dot") == 2 and "<img" not in pads_html(None)
