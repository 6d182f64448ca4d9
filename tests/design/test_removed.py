"""What version 0.2 removed is refused in one line that says so; what version 0.1 wrote without it is still read."""

import pytest

from scanwright.design.catalogue.catalogue import load_catalogue, load_product
from scanwright.design.errors import REMOVED, TaskError
from scanwright.design.task.task import load_task

TASK = {"name": "old", "sensor": "UTM-30LX", "servo": "MX-64R", "slip_ring": "UH1256-02-0610-06S"}
SPIN = {"motion": {"mode": "spin", "period_s": 18.0}}
OF_TASKS = {
    "homing_flag": {"modules": {"homing_flag": True}},
    "ring_cover": {"modules": {"ring_cover": True}},
    "cnc": {"printer": "cnc"},
    "PD42-3-1140": {"servo": "PD42-3-1140"},
}


@pytest.mark.parametrize("name", OF_TASKS)
def test_a_task_that_uses_a_removed_thing_gets_one_line_with_what_to_use_instead(name):
    with pytest.raises(TaskError) as refused:
        load_task(TASK | SPIN | OF_TASKS[name])
    (line,) = str(refused.value).splitlines()
    assert name in line and f"removed in 0.2: {REMOVED[name]}" in line


@pytest.mark.parametrize("name", ["cnc", "EE-SX672", "PD42-3-1140"])
def test_a_removed_product_is_not_listed_and_says_what_to_use_instead(name):
    with pytest.raises(TaskError, match=r"removed in 0\.2"):
        load_catalogue().named(name)


def test_a_product_file_of_a_removed_kind_is_refused_in_one_line(tmp_path):
    (tmp_path / "mine.toml").write_text('kind = "slot_switch"\nname = "mine"\nmaker = "me"\n', encoding="utf-8")
    with pytest.raises(TaskError, match=r"removed in 0\.2") as refused:
        load_product(tmp_path / "mine.toml")
    assert "\n" not in str(refused.value)


def test_the_resolved_task_of_an_old_build_is_read():
    """Version 0.1 wrote every default out, those of modules that are no longer there included."""
    old = {"ring_cover": False, "tripod_foot": True, "homing_flag": False}
    new = load_task(TASK | SPIN | {"modules": {"tripod_foot": True}})
    assert load_task(TASK | SPIN | {"modules": old}).task == new.task


def test_a_printer_of_metal_is_refused():
    plastic = load_catalogue().named("sla")
    with pytest.raises(ValueError, match="STEP files"):
        type(plastic).model_validate(plastic.model_dump() | {"modulus_gpa": 70.0})
