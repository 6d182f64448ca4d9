"""The studio in a real browser: what a person does with it, from the first look to the saved task."""

import io
import re
import shutil
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest
import viser.transforms
from matplotlib.image import imread

from scanwright.design.progress import no_progress
from scanwright.design.search.optimum import find_optimum
from scanwright.design.self_occlusion import AXIS_STEPS, SelfOcclusion
from scanwright.design.task.task import load_task
from scanwright.pipeline.build import setting_built
from scanwright.report.colours import ramp
from scanwright.serving import density_room
from scanwright.serving.page_server import guarded_server
from scanwright.studio import searching
from scanwright.studio.page import Studio
from scanwright.studio.panel.saving import BuildProcess
from scanwright.studio.state import Dab, Setting, painted
from scanwright.studio.view import workers
from scanwright.studio.view.scanner_bodies import BodyMesh

HARMLESS = ("THREE.Clock", "GPU stall", "GL Driver Message", "inside passive event listener")

GROUND = """(selector) => {
  for (let at = document.querySelector(selector); at; at = at.parentElement) {
    const colour = getComputedStyle(at).backgroundColor.match(/[\\d.]+/g).map(Number);
    if (colour.length < 4 || colour[3] > 0) return colour;
  }
}"""
MIDDLE = """() => {
  const { camera, canvas, nodeRefFromName } = window.__viserMutable;
  const at = nodeRefFromName[''].localToWorld(camera.position.clone().set(0, 0, 0)).project(camera);
  const box = canvas.getBoundingClientRect();
  return [box.left + ((1 + at.x) / 2) * box.width, box.top + ((1 - at.y) / 2) * box.height];
}"""


def box(_scanner, turning):
    """A stand-in for the kernel."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32) / 30
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1]], np.uint32)
    return (BodyMesh("box", corners + (0.1 if turning else -0.1), faces, (200, 90, 20)),)


def dots(_scanner, joint_rad, _placed, _folder):
    return np.tile(np.linspace(-0.5, 0.5, len(joint_rad), dtype=np.float32)[:, None], 3)


class FirstBeamsBlocked:
    """A stand-in for the parts: they block the first 54 of 1,081 beams of every mount."""

    def __init__(self, scanner):
        blocked = np.arange(len(scanner.lidar.bearings_rad())) < 54
        self.blocked = SelfOcclusion(blocked, np.zeros((len(blocked), AXIS_STEPS), bool))

    def bound(self, _setting_rad):
        return self.blocked

    shadow = bound


def setting_without_kernel(optimum):
    """What a worker process does for the button `Optimise`; the parts are a stand-in."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scanwright.cad.assembly.shadow.PartsWorkshop", FirstBeamsBlocked)
        return setting_built(optimum)


@contextmanager
def opened(folder, text):
    """The studio of a task, without the kernel, as it is started in a folder."""
    (folder / "small.toml").write_text(text)
    with guarded_server("a page") as (server, gate), pytest.MonkeyPatch.context() as patch:
        patch.setattr(density_room, "NODES", 300)  # drawn without a graphics card here
        patch.setattr(workers, "make_bodies", box)
        patch.setattr(workers, "one_scan", dots)
        patch.setattr(searching, "setting_built", setting_without_kernel)
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


def shown(browser, address, width, height, **options):
    """The page at half the resolution of its layout, drawn three times a second: by the processor here."""
    return browser.open(address, width, height, frame_ms=300, device_scale_factor=0.5, **options)


def enter(page, number, value):
    """Type an angle beside its slider."""
    field = page.locator("input[type=text]:visible").nth(number)
    field.fill(f"{value:g}")
    field.press("Enter")
    field.blur()


def contrast(*colours):
    """Of two colours 0 .. 255, as the guidelines for accessible pages (WCAG 2) define it."""
    c = np.array(colours) / 255
    light = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722] + 0.05
    return light.max() / light.min()


def tab(page, name):
    page.get_by_role("tab", name=name).click()


def harmless(browser):
    """Forget what Chromium without a graphics card complains of."""
    browser.complaints[:] = [said for said in browser.complaints if not any(word in said for word in HARMLESS)]


def has_the_colours_of_the_scale(page):
    """Whether the picture is drawn: many colours, and most of those beside the scanner are on the scale."""
    picture = imread(io.BytesIO(page.locator("canvas").first.screenshot(timeout=90_000)))
    pixels = (picture[::4, ::4, :3] * 255).astype(int).reshape(-1, 3)
    tiles = (picture[80:, :240, :3] * 255).astype(int)[::2, ::2].reshape(-1, 3)
    tiles = tiles[(tiles < 250).any(axis=1)]
    if len(np.unique(pixels, axis=0)) <= 100 or not len(tiles):
        return False
    off = np.abs(tiles[:, None] - ramp(np.linspace(0, 1, 64)).astype(int)).max(axis=2).min(axis=1)
    return (off < 12).mean() > 0.6


def test_a_person_finds_paints_keeps_and_saves(studio, browser, folder, command):
    studio, gate = studio
    page = shown(browser, gate.address, 900, 560)
    page.set_default_timeout(90_000)
    page.get_by_text("exact").wait_for()

    # the picture is one, never a pale one, and its colours are those of the scale beside it
    assert page.evaluate("[__viserMutable.scene.environment, __viserMutable.canvas.style.opacity]") == [None, "1"]
    until(lambda: has_the_colours_of_the_scale(page))

    # a slider moves J to the value that evaluate prints
    enter(page, 1, -50.0)
    until(lambda: studio.facts.exact and studio.facts.setting == Setting((0, -50, 0, -90)))
    code, printed, _ = command("evaluate", folder / "small.toml", "--angles=0,-50,0,-90")
    J = re.search(r"^J +(\S+)", printed, re.M)[1]
    assert code == 0 and f"{studio.facts.J:.5f}" == J
    page.get_by_text(J, exact=True).wait_for()

    # a painted region changes the optimum, and the button finds a better one for it
    before = find_optimum(load_task(folder / "small.toml"), no_progress).search.best[0].angles_deg
    tab(page, "Paint")
    page.get_by_label("brush").check()
    until(lambda: studio.controls.painting.value)
    studio.controls.weight.value = 50.0
    until(lambda: len(studio.judge.loaded.task.weight) == 2, meanwhile=lambda: page.mouse.click(380, 210))
    (client,) = studio._server.get_clients().values()
    axis = np.array(studio.judge.loaded.task.weight[1].axis)
    ray = [*((np.array([380, 210]) - (450, 280)) / (280 / np.tan(client.camera.fov / 2))), 1.0]
    ray = viser.transforms.SO3(client.camera.wxyz).as_matrix() @ ray
    assert axis @ studio.view.room.beyond(np.array(client.camera.position), ray) > np.cos(np.radians(0.3))
    studio.controls.density.value = False  # what is not drawn costs no time
    tab(page, "Angles")
    page.get_by_role("button", name="Optimise").click()
    page.get_by_text("searching the equivalent mount").wait_for()
    page.get_by_text("with parts, which block 5% of the beams").wait_for(timeout=300_000)  # ten times what it needs
    until(lambda: studio.facts.exact and studio.setting == studio.facts.setting)
    dab = studio.judge.loaded.task.weight[1]
    assert dab.half_angle_deg == 12.0 and dab.value == 50.0
    found = studio.setting
    assert studio.facts.J < studio.judge.exact(Setting(before)).J - 0.01
    page.keyboard.press("b")
    until(lambda: not studio.controls.painting.value)

    # side by side, and back
    page.get_by_role("button", name="Keep this setting").click()
    page.get_by_text("saved as A").wait_for()
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
    page.get_by_text("name: use letters, digits, _ and -").wait_for()
    page.locator(".mantine-TextInput-input:visible").first.fill("mine")
    page.locator(".mantine-TextInput-input:visible").first.blur()
    until(lambda: studio.controls.name.value == "mine")
    page.get_by_role("button", name="Save task").click()
    page.get_by_text(f"saved to {folder / 'mine.toml'}").wait_for()
    saved = load_task(folder / "mine.toml")
    assert saved.task.weight == studio.judge.loaded.task.weight
    assert sorted(path.name for path in folder.glob("*.toml")) == ["mine.toml", "small.toml"]
    harmless(browser)


def test_a_saved_task_builds(browser, tmp_path, made):
    """By the program that a person would call: it finds its build of this very task, made in this session, current."""
    shutil.copytree(made.folder, tmp_path / "out" / "tilted")
    with opened(tmp_path, (made.folder / "task.toml").read_text()) as (studio, gate):
        page = shown(browser, gate.address, 600, 400)
        page.set_default_timeout(300_000)
        studio.controls.density.value = False
        tab(page, "Save")
        studio.controls.name.value = "tilted"
        page.get_by_role("button", name="Save and build").click()
        page.get_by_text(f"built {tmp_path / 'out' / 'tilted'}: open its report.html").wait_for()
    assert load_task(tmp_path / "tilted.toml").sha256() == load_task(made.folder / "task.toml").sha256()
    harmless(browser)


@pytest.mark.parametrize("code", [0, 2])
def test_what_a_build_says_is_told_as_progress(tmp_path, monkeypatch, code):
    program = tmp_path / "program"
    lines = "".join(f"echo '  .. line {number} ({number}%)'\n" for number in range(60)) + "echo '  .. more'\n"
    program.write_text(f'#!/bin/sh\necho "$@"\n{lines}exit {code}\n')
    program.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(program))
    told, ended = [], []
    ends = (lambda *each: told.append(each)), (lambda *end: ended.append(end))
    build = BuildProcess(tmp_path / "a.toml", tmp_path / "out", *ends)
    until(lambda: ended)
    build.stop()
    shares, said = zip(*told, strict=True)
    assert said[:2] == (f"-P -m scanwright build {tmp_path / 'a.toml'} --out {tmp_path / 'out'}", "line 0 (0%)")
    assert shares == (0, *(number / 100 for number in range(60)), 0.59)
    assert ended == [(code, "more")] and not build.runs


def test_a_link_opens_its_setting_and_what_is_wrong_is_said_at_its_field(studio, browser):
    studio, gate = studio
    page = shown(browser, f"{gate.address}#angles=10,-20,30,-40", 700, 500)
    until(lambda: studio.setting == Setting((10, -20, 30, -40)))
    studio.show("of this setting alone")
    page.get_by_text("of this setting alone").wait_for()
    studio.move(Setting((0, 50, 0, -60)))
    page.wait_for_function("location.hash === '#angles=0,50,0,-60'")
    assert studio.controls.note.content == ""  # a message goes with its state
    field = page.get_by_label("angles [deg]")
    assert field.input_value() == "0, 50, 0, -60"
    field.fill("0, 95, 0, -60")
    field.blur()
    page.get_by_text("95 deg is out of bounds (allowed -90 to 90)").wait_for()
    assert studio.setting == Setting((0, 50, 0, -60))
    field.fill("0, 45, 0, -60")
    field.blur()
    until(lambda: studio.setting == Setting((0, 45, 0, -60)) and not studio.controls.typed_error.content)

    # pads: arrow keys, and a drag that is one step; a key moves what the page shows
    page.wait_for_function("location.hash === '#angles=0,45,0,-60'")
    page.get_by_label("Where the axis points").press("ArrowRight")
    until(lambda: studio.setting == Setting((1, 45, 0, -60)))
    page.wait_for_function("location.hash === '#angles=1,45,0,-60'")
    box = page.locator(".sw-pad").last.bounding_box()
    page.mouse.move(box["x"] + 5, box["y"] + 5)
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 0.25 * box["height"])
    page.mouse.up()
    until(lambda: np.allclose(studio.setting.angles_deg, (1, 45, 45, 45), atol=1))
    harmless(browser)


def keeps_nobody_out_of_any_tab(studio, browser, page, scheme):
    """Whether axe-core finds nothing in any tab, while a refusal and the mode of painting are shown."""
    studio.show("what is refused", bad=True)
    studio.controls.painting.value = True  # the line of its mode stands on the view
    page.get_by_role("status").get_by_text("Painting").wait_for()
    for tab in ("Angles", "Paint", "Compare", "View", "Save"):
        page.get_by_role("tab", name=tab).click()
        page.get_by_role("tab", name=tab, selected=True).wait_for()
        assert browser.barriers(page) == []
    open_tab = "[role=tab][aria-selected=true]"
    word = page.locator(open_tab).evaluate("(tab) => getComputedStyle(tab).color.match(/[\\d.]+/g).map(Number)")
    assert contrast(word, page.evaluate(GROUND, open_tab)) >= 4.5  # which axe-core does not see
    assert page.evaluate(GROUND, "canvas[data-engine]") == {"light": [255, 255, 255], "dark": [20, 20, 20]}[scheme]
    studio.controls.painting.value = False
    studio.show("")
    page.get_by_role("tab", name="Angles").click()
    page.get_by_role("slider", name="beta_rot").wait_for()  # by the name that a screen reader says


def reaches_and_moves_every_control_by_the_keyboard(studio, page):
    """Whether a person without a mouse gets to each control of the first tab, and moves a slider."""
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


@pytest.mark.parametrize(("size", "scheme"), [((1000, 700), "light"), ((720, 450), "dark")])
def test_nobody_is_kept_out_of_any_tab_nor_without_a_mouse(studio, browser, size, scheme):
    studio, gate = studio
    page = shown(browser, gate.address, *size, color_scheme=scheme)
    page.get_by_text("exact").wait_for()
    keeps_nobody_out_of_any_tab(studio, browser, page, scheme)
    if scheme == "light":
        reaches_and_moves_every_control_by_the_keyboard(studio, page)
    harmless(browser)


def test_on_a_phone_the_panel_is_a_sheet_that_fingers_can_use_and_all_can_read(studio, browser):
    studio, gate = studio
    page = shown(browser, gate.address, 390, 844, has_touch=True, color_scheme="light")
    page.set_default_timeout(90_000)
    page.get_by_text("exact").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    sheet = page.locator(".sw-sheet").bounding_box()
    assert sheet["x"] == 0 and sheet["width"] == 390 and sheet["y"] > 0.4 * 844
    until(lambda: page.locator("canvas[data-engine]").bounding_box()["height"] == pytest.approx(sheet["y"], abs=1))
    until(
        lambda: page.evaluate(MIDDLE) == pytest.approx([195, sheet["y"] / 2], abs=3)
    )  # the scanner is in what is free
    for control in page.locator(".sw-sheet").get_by_role("button").or_(page.get_by_role("tab")).all():
        if control.is_visible():
            touched = "(control) => (control.closest('.sw-pad') ?? control).getBoundingClientRect().height"
            assert control.evaluate(touched) >= 44  # the dot of a pad moves to where the pad is touched
    keeps_nobody_out_of_any_tab(studio, browser, page, "light")
    harmless(browser)


def test_every_change_can_be_undone_and_done_again(studio, browser):
    studio, gate = studio
    c = studio.controls
    page = shown(browser, gate.address, 1000, 700)
    page.get_by_text("exact").wait_for()
    c.density.value, c.weight.value = False, 1.0  # what is not drawn costs no time
    studio._paint(())
    studio.move(Setting((0, 90, 0, -90)))
    first = studio._state()
    undo = page.get_by_role("button", name=re.compile("^Undo"))
    words = []

    def did(text):
        page.get_by_role("button", name=f"Undo: {text}").wait_for()
        words.append(text)

    enter(page, 3, -40.5)
    did("beta_laser -90 to -40.5")
    tab(page, "Paint")
    weight = page.locator(".mantine-NumberInput-input:visible").last
    weight.fill("7.5")
    did("weight 1 to 7.5")
    studio._paint((Dab((1.0, 0.0, 0.0), 12.0, "matters"),), 1)
    studio._paint((Dab((1.0, 0.0, 0.0), 12.0, "matters"), Dab((0.9, 0.2, 0.0), 12.0, "matters")), 1)
    did("paint 2 dabs")
    page.get_by_role("button", name="Clear paint").click()
    did("clear paint")
    tab(page, "Angles")
    page.get_by_role("button", name="Keep this setting").click()
    did("keep ")
    tab(page, "Save")
    page.get_by_label("overwrite").check()
    did("overwrite off to on")
    last = studio._state()

    for text in reversed(words):
        page.get_by_role("button", name=f"Undo: {text}").wait_for()
        page.keyboard.press("Control+z")
        page.get_by_role("button", name=f"Redo: {text}").wait_for()
    assert studio._state() == first
    assert page.get_by_role("slider", name="beta_laser", include_hidden=True).get_attribute("aria-valuenow") == "-90"
    for _ in words:
        page.get_by_role("button", name="Redo: ").wait_for()
        before = undo.inner_text()
        page.keyboard.press("Control+Shift+z")
        until(lambda before=before: undo.inner_text() != before)
    assert studio._state() == last and c.redo.disabled

    # in a field what was typed is the field's own, and nothing else is
    tab(page, "Angles")
    field = page.locator("input[type=text]:visible").nth(1)
    field.fill("33")
    until(lambda: studio.setting.angles_deg[1] == 33)
    field.press("Enter")
    field.press("Control+z")
    until(lambda: studio._state() == last)
    undo.click()
    until(lambda: not c.overwrite.value)
    assert studio.painting.settled(60)
    harmless(browser)


def test_the_page_cannot_be_had_without_its_token(studio, browser):
    _, gate = studio
    page = browser.open(gate.address.split("?")[0], width=400, height=300)
    assert "refused: no token" in page.inner_text("body")
    assert page.locator("canvas").count() == 0
    page.context.close()  # so that no request of it, such as for an icon, is refused later
    browser.complaints.clear()  # the browser's own word on the 403


def test_values_that_no_control_holds_do_nothing(studio):
    studio, _ = studio
    before = studio.judge
    studio.controls.painting.value = True
    studio.controls.brush.value = "gold"
    studio.brush.dab((3.0, 0.0, 0.0), (-1.0, 0.0, 0.0))
    assert studio.painting.settled(20) and studio.judge is before
    assert painted(before.loaded, ()).task == before.loaded.task
