"""The studio in a real browser: what a person does with it, from the first look to the saved task."""

import io
import json
import re
import time
from contextlib import contextmanager

import numpy as np
import pytest
from matplotlib.image import imread

from design.angles import load_angles
from design.search.optimum import find_optimum
from design.task.task import load_task
from scanwright.serving.page_server import guarded_server
from scanwright.studio.page import Studio
from scanwright.studio.state import Setting, painted
from scanwright.studio.view import coloured_sphere, workers
from scanwright.studio.view.scanner_bodies import BodyMesh

HARMLESS = ("THREE.Clock", "GPU stall", "GL Driver Message", "inside passive event listener")


def box(_scanner, turning):
    """A stand-in for the kernel."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32) / 30
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]], np.uint32)
    return (BodyMesh("box", corners + (0.1 if turning else -0.1), faces, (200, 90, 20)),)


def dots(_scanner, joint_rad, _placed, _folder):
    return np.tile(np.linspace(-0.5, 0.5, len(joint_rad), dtype=np.float32)[:, None], 3)


@contextmanager
def opened(folder, text):
    """The studio of a task, without the kernel, as it is started in a folder."""
    (folder / "small.toml").write_text(text)
    with guarded_server("a page") as (server, gate), pytest.MonkeyPatch.context() as patch:
        patch.setattr(coloured_sphere, "TILES", 300)  # drawn without a graphics card here
        patch.setattr(workers, "make_bodies", box)
        patch.setattr(workers, "preview_scan", dots)
        studio = Studio(server, load_task(folder / "small.toml"), folder, folder / "out")
        try:
            yield studio, gate
        finally:
            studio.close()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("started_in")


@pytest.fixture(scope="module")
def studio(folder, small_task):
    """One for all tests: each takes it as it finds it."""
    fewer = small_task.replace("[angles]\n", "[angles]\nalpha_rot_deg = 0\nalpha_laser_deg = 0\n")  # soon searched
    with opened(folder, fewer) as found:
        yield found


def until(true, seconds=60.0, meanwhile=lambda: None):
    """Wait for something that another thread does, or that comes of what is done again and again meanwhile."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "did not happen"
        meanwhile()
        time.sleep(0.1)


def enter(page, number, value):
    """Type an angle beside its slider."""
    field = page.locator("input[type=text]:visible").nth(number)
    field.fill(f"{value:g}")
    field.press("Enter")
    field.blur()


def tab(page, name):
    page.get_by_role("tab", name=name).click()


def harmless(browser):
    """Forget what Chromium without a graphics card complains of."""
    browser.complaints[:] = [said for said in browser.complaints if not any(word in said for word in HARMLESS)]


def test_a_person_finds_paints_keeps_and_saves(studio, browser, folder, command):
    studio, gate = studio
    page = browser.open(gate.address, width=900, height=560)
    page.set_default_timeout(90_000)
    page.get_by_text("exact").wait_for()

    # the picture is one
    picture = imread(io.BytesIO(page.locator("canvas").first.screenshot(timeout=90_000)))
    assert len(np.unique((picture[::4, ::4, :3] * 255).astype(int).reshape(-1, 3), axis=0)) > 100

    # a slider moves J to the value that evaluate prints
    enter(page, 1, -50.0)
    until(lambda: studio.facts.exact and studio.facts.setting == Setting((0, -50, 0, -90)))
    code, printed, _ = command("evaluate", folder / "small.toml", "--angles=0,-50,0,-90")
    J = re.search(r"^J +(\S+)", printed, re.M)[1]
    assert code == 0 and f"{studio.facts.J:.5f}" == J
    page.get_by_text(J, exact=True).wait_for()

    # a painted region changes the optimum, and the button finds a better one for it
    before = find_optimum(load_task(folder / "small.toml"), lambda _: None).search.best[0].angles_deg
    tab(page, "Paint")
    page.get_by_label("brush").check()
    until(lambda: studio.controls.painting.value)
    studio.controls.weight.value = 50.0
    until(lambda: len(studio.judge.loaded.task.weight) == 2, meanwhile=lambda: page.mouse.click(380, 210))
    tab(page, "Angles")
    page.get_by_role("button", name="Optimise").click()
    page.get_by_text("is still looked for").wait_for()
    page.get_by_text("with its parts, which hide").wait_for(timeout=300_000)  # ten times what it needs
    until(lambda: studio.facts.exact and studio.setting == studio.facts.setting)
    dab = studio.judge.loaded.task.weight[1]
    assert dab.half_angle_deg == 12.0 and dab.value == 50.0
    found = studio.setting
    assert studio.facts.J < studio.judge.exact(Setting(before)).J - 0.01
    studio.controls.look.value = "hidden"  # what is not drawn costs no time

    # side by side, and back
    page.get_by_role("button", name="Keep this setting").click()
    page.get_by_text("kept as A").wait_for()
    enter(page, 0, 10.0)
    until(lambda: studio.setting.angles_deg[0] == 10.0)
    tab(page, "Compare")
    page.get_by_role("button", name="Restore").click()
    until(lambda: studio.setting == found)

    # the scanner and a scan are shown
    assert studio.workers.settled(60)
    studio.controls.scene.value = "furnished room"
    until(lambda: studio.view.points > 0)

    # a saved task is what was on the page
    tab(page, "Save")
    page.locator(".mantine-TextInput-input:visible").first.fill("../evil")
    page.locator(".mantine-TextInput-input:visible").first.blur()
    page.get_by_role("button", name="Save task").click()
    page.get_by_text("a task name becomes a folder name").wait_for()
    page.locator(".mantine-TextInput-input:visible").first.fill("mine")
    page.locator(".mantine-TextInput-input:visible").first.blur()
    until(lambda: studio.controls.name.value == "mine")
    page.get_by_role("button", name="Save task").click()
    page.get_by_text(f"saved to {folder / 'mine.toml'}").wait_for()
    saved = load_task(folder / "mine.toml")
    assert saved.task.weight == studio.judge.loaded.task.weight
    assert sorted(path.name for path in folder.glob("*.toml")) == ["mine.toml", "small.toml"]
    harmless(browser)


def test_a_saved_task_builds(browser, tmp_path, cheapest_task):
    with opened(tmp_path, cheapest_task) as (studio, gate):
        page = browser.open(gate.address, width=600, height=400)
        page.set_default_timeout(300_000)
        studio.controls.look.value = "hidden"
        tab(page, "Save")
        page.get_by_role("button", name="Save and build").click()
        page.locator(".mantine-Progress-root:visible").wait_for()
        seen = []
        until(
            lambda: "report.html" in studio.controls.built.content or "ended" in studio.controls.built.content,
            seconds=300,
            meanwhile=lambda: seen.append(studio.controls.building.value),
        )
        page.get_by_text(f"built {tmp_path / 'out' / 'ahead_mine'}: open its report.html").wait_for()
    assert seen == sorted(seen) and len(set(seen)) > 5
    built = tmp_path / "out" / "ahead_mine"
    assert load_angles(built / "angles.json").angles_deg.beta_laser == -60
    files = json.loads((built / "manifest.json").read_text())["files"]
    assert {"report.html", "assembly.step"} <= files.keys() and all((built / name).is_file() for name in files)
    harmless(browser)


def test_on_a_phone_the_facts_can_be_read(studio, browser):
    studio, gate = studio
    page = browser.open(gate.address, width=390, height=780)
    page.set_default_timeout(90_000)
    page.get_by_text("exact").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    harmless(browser)


@pytest.mark.parametrize("size", [(1440, 900), (390, 844)])
def test_nobody_is_kept_out_of_any_tab(studio, browser, size):
    _, gate = studio
    page = browser.open(gate.address, *size)
    page.get_by_text("exact").wait_for()
    for tab in ("Angles", "Paint", "Compare", "View", "Save"):
        page.get_by_role("tab", name=tab).click()
        page.get_by_role("tab", name=tab, selected=True).wait_for()
        assert browser.barriers(page) == []
    page.get_by_role("tab", name="Angles").click()
    page.get_by_role("slider", name="beta_rot").wait_for()  # by the name that a screen reader says
    harmless(browser)


def test_every_control_is_reached_and_moved_by_the_keyboard(studio, browser):
    studio, gate = studio
    page = browser.open(gate.address, width=1000, height=700)
    page.get_by_text("exact").wait_for()
    page.get_by_role("tab", name="Angles").focus()
    name = "document.activeElement.getAttribute('aria-label') || document.activeElement.textContent"
    reached = []
    while len(reached) < 20 and "Keep this setting" not in reached:
        page.keyboard.press("Tab")
        reached.append(page.evaluate(name))
    angles = ("alpha_rot", "beta_rot", "alpha_laser", "beta_laser")
    assert all(reached.count(angle) == 2 for angle in angles)  # slider and number
    assert "Optimise" in reached
    slider = page.get_by_role("slider", name="beta_laser")
    before = float(slider.get_attribute("aria-valuenow"))
    slider.focus()
    page.keyboard.press("ArrowRight")
    until(lambda: studio.controls.angles[3].value != before)
    harmless(browser)


def test_on_a_phone_the_panel_is_a_sheet_that_fingers_can_use(studio, browser):
    _, gate = studio
    page = browser.open(gate.address, width=390, height=844, has_touch=True)
    page.get_by_text("exact").wait_for()
    sheet = page.locator(".sw-sheet").bounding_box()
    assert sheet["x"] == 0 and sheet["width"] == 390 and sheet["y"] > 0.4 * 844
    for control in page.locator(".sw-sheet").get_by_role("button").or_(page.get_by_role("tab")).all():
        if control.is_visible():
            assert control.bounding_box()["height"] >= 44
    harmless(browser)


def test_the_page_cannot_be_had_without_its_token(studio, browser):
    _, gate = studio
    page = browser.open(gate.address.split("?")[0], width=400, height=300)
    assert "refused: no token" in page.inner_text("body")
    assert page.locator("canvas").count() == 0
    browser.complaints.clear()  # the browser's own word on the 403


def test_values_that_no_control_holds_do_nothing(studio):
    studio, _ = studio
    before = studio.judge
    studio.controls.task.value = "/etc/passwd"
    studio.controls.look.value = "through"
    studio.controls.painting.value = True
    studio.controls.brush.value = "gold"
    studio.dab((3.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    assert studio.painting.settled(20) and studio.judge is before
    assert painted(before.loaded, ()).task == before.loaded.task
    assert "none of those" in studio.controls.note.content
