"""Studies without a cluster: what is crossed, who beats whom, and that the answer does not depend on who was first."""

import random
import sys
import time
from collections import Counter
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.scanwright.study.invented import invented_judge, invented_search, invented_study
from scanwright.design.catalogue.catalogue import load_catalogue
from scanwright.design.errors import TaskError
from scanwright.design.progress import no_progress
from scanwright.design.task.named_record import names_in
from scanwright.design.task.task import SHIPPED as TASKS
from scanwright.design.task.task import Limits, load_task
from scanwright.study.candidate import addresses, bounds_of, record_digest, search_record, winner_task
from scanwright.study.crossing import Crossing, _with_period
from scanwright.study.front import COLUMNS, Front, costs
from scanwright.study.results import open_results
from scanwright.study.run import StudyRun
from scanwright.study.study import SHIPPED, load_study
from scanwright.study.table import FIELDS, write_answer, write_tables
from scanwright.study.units import Crew

rows = st.lists(st.tuples(*[st.integers(0, 4)] * 3), min_size=1, max_size=30)


@given(rows, st.randoms(use_true_random=False))
def test_a_front_is_what_nothing_beats_in_whatever_order(points, dice):
    costs = np.array(points, dtype=float)
    costs[costs == 4] = np.inf  # not known
    beaten = [any(all(q <= p) and any(q < p) for q in costs) for p in costs]
    front = Front(3)
    order = list(range(len(points)))
    dice.shuffle(order)
    for i in order:
        front.add(i, costs[i])
    assert set(front.numbers.tolist()) == {i for i, lost in enumerate(beaten) if not lost}
    for i, lost in enumerate(beaten):
        assert (front.beater(costs[i]) is not None) == lost


def test_the_shipped_study_crosses_everything_and_refuses_with_a_reason():
    crossing = Crossing(load_study(Path("fleet")))
    combinations = list(crossing)
    assert len(combinations) == len(crossing) == 3 * 3 * 2 * 2
    assert len({c.name for c in combinations}) == 36
    refused = [c for c in combinations if c.loaded is None]
    assert len(refused) == 12
    assert all(c.choice["servo"] == "AX-12A" and "no angle is measured" in c.refused for c in refused)
    sweeping = [c for c in combinations if c.choice["task"] == "indoor_urg"]
    assert all(c.loaded.task.slip_ring is None for c in sweeping)
    assert len({record_digest(c.loaded) for c in sweeping}) == 6  # the same with either ring: made once
    assert len({record_digest(search_record(c.loaded)) for c in combinations if c.loaded}) == 9
    assert combinations[17].name == crossing[17].name


def crossed(text, tmp_path, **files):
    for name, content in files.items():
        (tmp_path / f"{name}.toml").write_text(content)
    path = tmp_path / "study.toml"
    path.write_text('name = "small"\nfront = ["J"]\n' + text)
    return list(Crossing(load_study(path)))


def test_periods_and_mountings_take_the_place_of_those_of_the_task(tmp_path):
    mountings = (
        '[[mounting]]\nname = "upright"\nangles = { beta_rot_deg = 0, step_deg = 10 }\n[[mounting]]\nname = "any"\n'
    )
    few = 'tasks = ["ground_ahead"]\nperiods_s = [2.0, 0.5, "shortest"]\n' + mountings
    found = crossed(few, tmp_path)
    assert [(c.choice["mounting"], c.choice["period"]) for c in found] == [
        (mounting, period) for mounting in ("upright", "any") for period in ("2s", "0.5s", "shortest")
    ]
    upright, fast, shortest = found[:3]
    base = load_task(Path("ground_ahead")).task
    assert upright.loaded.task.angles == base.angles.model_copy(update={"beta_rot_deg": 0.0, "step_deg": 10.0})
    assert found[3].loaded.task.angles == base.angles
    assert upright.loaded.task.motion.period_s == 2.0
    assert shortest.loaded.task.motion.mode == "shortest"
    assert "servo = 'MX-64R' turns at 63 rpm" in fast.refused  # 120 rpm
    with pytest.raises(TaskError, match="no period"):
        _with_period({"mode": "stop_and_go"}, 2.0)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('tasks = ["rolling"]\nfront = ["J", "mas_g"]', "front.*'mas_g' is no column; did you mean 'mass_g'"),
        ('tasks = ["rolling"]\nfront = []', "front"),
        ('tasks = ["roling"]\nfront = ["J"]', "no such task file"),
        ('tasks = ["rolling"]\nfront = ["J"]\nsensors = ["UTM-30L"]', "sensors: 'UTM-30L' is no lidar.*UTM-30LX"),
        ('tasks = ["rolling"]\nfront = ["J"]\nservos = ["MX-64R", "MX-64R"]', "servos.*'MX-64R' is named twice"),
        ('tasks = ["rolling"]\nfront = ["J"]\nperiods_s = [0.0]', "periods_s"),
        ('tasks = ["rolling"]\nfront = ["J"]\nsensor = ["UTM-30LX"]', "sensor: unknown key; did you mean 'sensors'"),
        ('tasks = ["rolling"]\nfront = ["J"]\n[[mounting]]\nname = "a"\nangles = { beta = 3 }', "unknown key"),
    ],
)
def test_wrong_studies_get_one_line(tmp_path, command, line, says):
    path = tmp_path / "wrong.toml"
    path.write_text(f'name = "wrong"\n{line}\n')
    code, _, complaint = command("study", path, "--plan")
    assert code == 2
    assert len(complaint) == 1
    assert "wrong.toml" in complaint[0]
    with pytest.raises(TaskError, match=says):
        load_study(path)


def test_the_name_decides_nothing_and_a_servo_no_search():
    one, other = (load_task(Path("rolling")) for _ in range(2))
    other = replace(other, task=other.task.model_copy(update={"name": "another"}))
    assert addresses(one) == addresses(other)
    other = replace(other, task=other.task.model_copy(update={"servo": "MX-28"}))
    assert addresses(one)[0] == addresses(other)[0]
    assert addresses(one)[1] != addresses(other)[1]


class InSomeOrder(Executor):
    """Units that end in any order, one after the other in a thread."""

    def __init__(self, seed):
        self.dice, self.thread, self.at_work = random.Random(seed), ThreadPoolExecutor(1), []

    def submit(self, function, *arguments):
        future = Future()
        self.at_work.append((future, function, arguments))
        self.thread.submit(self.end_one)
        return future

    def end_one(self):
        time.sleep(0.002)  # for others to come
        future, function, arguments = self.at_work.pop(self.dice.randrange(len(self.at_work)))
        try:
            future.set_result(function(*arguments))
        except BaseException as error:
            future.set_exception(error)


def crew(seed=0, at_once=6):
    return Crew(InSomeOrder(seed), lambda: at_once)


def test_the_table_is_that_of_all_candidates_whoever_is_first(tmp_path):
    loaded = invented_study(60, mountings=3)
    crossing = Crossing(loaded)
    names = loaded.study.front
    every = []  # the slow obvious way: make all, then ask who beats whom
    for c in crossing:
        found = invented_search(search_record(c.loaded))
        bound = costs(bounds_of(c.loaded, found), names)
        every.append((bound, costs(invented_judge(c.loaded, found)["values"], names)))

    def beaten(cost):
        return any((other <= cost).all() and (other < cost).any() for _, other in every)

    expected = ["dominated" if beaten(b) else "built" if beaten(c) else "front" for b, c in every]
    assert min(Counter(expected)[status] for status in ("dominated", "built", "front")) >= 2
    tables, made = set(), set()
    for seed in range(3):
        run = StudyRun(crossing, open_results(tmp_path / str(seed)), invented_judge, invented_search)
        run.work(crew(seed), no_progress)
        assert [row["status"] for row in run.rows()] == expected
        write_tables(tmp_path, run.rows())
        tables.add((tmp_path / "study.csv").read_bytes() + (tmp_path / "study.parquet").read_bytes())
        made.add(run.tally.judged)
        assert run.tally.judged + run.tally.beaten == len(crossing)
    assert len(tables) == 1
    assert max(made) < len(crossing)
    again = StudyRun(crossing, run.results, invented_judge, invented_search)
    again.work(crew(), no_progress)
    assert (again.tally.judged, again.tally.searches) == (0, 0)
    assert list(again.rows()) == list(run.rows())


def test_a_candidate_whose_bound_is_beaten_is_never_made(tmp_path):
    """With one unit at a time, nothing is at work when a bound is asked for."""
    run = StudyRun(Crossing(invented_study(60, mountings=3)), open_results(tmp_path), None, invented_search)
    wasted = []

    def judge(loaded, found):
        bound = costs(bounds_of(loaded, found), run.crossing.loaded.study.front)
        wasted.append(any((done <= bound).all() and (done < bound).any() for done in run.fronts[0].costs))
        return invented_judge(loaded, found)

    run.judge = judge
    run.work(crew(at_once=1), no_progress)
    assert not any(wasted)
    assert 0 < run.tally.beaten == 60 - len(wasted)
    assert run.tally.beaten == sum(row["status"] == "dominated" for row in run.rows())


def test_a_record_that_comes_twice_is_made_once(tmp_path):
    loaded = invented_study(6, mountings=3)
    same = tuple(mounting.model_copy(update={"limits": Limits()}) for mounting in loaded.study.mounting)
    loaded = replace(loaded, study=loaded.study.model_copy(update={"mounting": same}))
    run = StudyRun(Crossing(loaded), open_results(tmp_path), invented_judge, invented_search)
    run.work(crew(), no_progress)
    assert (run.tally.searches, run.tally.judged, run.tally.looked_up) == (2, 2, 4)
    by_name = {row["name"]: row for row in run.rows()}
    assert {row["status"] for row in by_name.values()} == {"front"}
    assert len({row["J"] for row in by_name.values()}) == 2


def test_both_tables_hold_the_same(tmp_path):
    import pyarrow.parquet as pq

    given = [
        {"name": "a", "status": "front", "reason": "", "J": -1.5},
        {"name": "b", "status": "refused", "reason": "é, \n"},
    ]
    assert write_tables(tmp_path, given) == Counter(front=1, refused=1)
    table = pq.read_table(tmp_path / "study.parquet").to_pylist()
    assert table == [dict.fromkeys(FIELDS) | row for row in given]
    lines = (tmp_path / "study.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0].split(",") == list(FIELDS)
    assert set(COLUMNS) <= set(FIELDS)
    assert not list(tmp_path.glob("*.part"))


def test_a_study_without_pyarrow_has_a_table_all_the_same(tmp_path, monkeypatch):
    rows = [{"name": "a", "task": "t", "status": "refused", "reason": "why"}]
    study = invented_study(2).study
    write_answer(study, rows, tmp_path)
    whole = (tmp_path / "study.csv").read_bytes()
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert "refused 1: why" in write_answer(study, rows, tmp_path)
    assert (tmp_path / "study.csv").read_bytes() == whole
    assert not (tmp_path / "study.parquet").exists()  # not an older one either


def test_a_winner_is_built_with_its_own_angles_and_period():
    loaded = load_task(Path("ground_ahead"))
    found = {"motion": {"mode": "spin", "period_s": 3.25}}
    task = winner_task(loaded, found, {"angles_deg": [-180.0, 55.0, 80.0, -75.0]}).task
    assert [task.angles.limits(name) for name in ("alpha_rot", "beta_laser")] == [(-180.0, -180.0), (-75.0, -75.0)]
    assert task.motion.period_s == 3.25


def test_a_product_of_the_study_goes_with_its_winners(tmp_path):
    shipped = Path(__file__).parents[3] / "design" / "catalogue" / "uh1256.toml"
    (tmp_path / "ring.toml").write_text(shipped.read_text().replace("UH1256-02-0610-06S", "my ring"))
    found = crossed('tasks = ["rolling"]\ncatalogue = ["ring.toml"]\nslip_rings = ["my ring", "none"]', tmp_path)
    mine, none = found
    assert mine.name == "rolling-my-ring"
    assert load_catalogue(*map(Path, mine.loaded.task.catalogue)).named("my ring")
    assert "needs a slip ring" in none.refused


def test_a_region_out_of_range_refuses_no_candidate(tmp_path):
    """It warns: another lidar of the study may reach, and a scanner that sees a part of it is one."""
    wall = '[[weight]]\nshape = "wall"\ndistance_m = 20\nwidth_m = 4\nheight_m = 0.5\n'
    text = (TASKS / "rolling.toml").read_text(encoding="utf-8")
    (tmp_path / "far.toml").write_text(text.replace('[[weight]]\nshape = "all"\n', wall), encoding="utf-8")
    (found,) = crossed('tasks = ["far.toml"]', tmp_path)
    assert found.refused == "" and "beyond the 15 m" in found.loaded.warnings()[0]


def test_every_shipped_study_can_be_read():
    assert "fleet" in names_in(SHIPPED)
    for name in names_in(SHIPPED):
        load_study(Path(name))
