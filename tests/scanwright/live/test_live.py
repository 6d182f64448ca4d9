"""The cloud while it grows: what is handed over, where its points lie, and that nobody waits for a viewer."""

import io
import itertools
import os
import re
import threading
from contextlib import nullcontext, suppress
from html import escape
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import typer
from patience import until
from PIL import Image
from scipy.stats import kstest
from websockets.sync.client import connect

from benchmarks.firmware_io.recordings.deskew import deskew
from scanwright.cli import devices
from scanwright.design.angles import Angles, AngleSet
from scanwright.design.errors import DeviceError, ScanwrightError, UnsafeError, UnsafeNote
from scanwright.design.task.task import load_task
from scanwright.firmware_io.clouds.formats import read_clouds
from scanwright.firmware_io.samples import JointLog, Scan
from scanwright.firmware_io.scan import scan_end
from scanwright.firmware_io.scan.live_feed import MOST_SCANS, Batch, CloudGrowth, Feed, Placing, growing
from scanwright.firmware_io.scan.scan_end import BETWEEN_STOPS, ScanSummary
from scanwright.live import cloud_view, scan_page
from scanwright.live.cloud_view import CloudView
from scanwright.live.ruler import Ruler, nearest_to_ray
from scanwright.live.scan_page import live_page
from scanwright.report.colours import COLOUR_STOPS
from scanwright.serving.page_server import guarded_server

HARMLESS = ("THREE.Clock", "GPU stall", "GL Driver Message", "inside passive event listener")  # without a graphics card
ANGLES = AngleSet(
    task="live",
    angles_deg=Angles(alpha_rot=10, beta_rot=-55, alpha_laser=-80, beta_laser=75),
    sensor="UTM-30LX",
    servo="MX-64R",
    motion={"mode": "spin", "period_s": 2.0},
)


def scan_at(index, beams=61):
    rng = np.random.default_rng(index)
    range_m = rng.uniform(0.2, 20, beams).astype(np.float32)
    range_m[::7] = np.inf
    return Scan(
        stamp_ns=1_000_000_000 + 25_000_000 * index,
        angle_min_rad=-2.3,
        angle_increment_rad=4.6 / (beams - 1),
        time_increment_s=18e-3 / beams,
        scan_time_s=0.025,
        range_min_m=0.1,
        range_max_m=30.0,
        range_m=range_m,
        intensity=range_m[:0],
    )


def joints(count):
    time_ns = 990_000_000 + 10_000_000 * np.arange(count)
    return JointLog(time_ns, 3.0 * (time_ns - time_ns[0]) / 1e9 + 0.001 * np.sin(np.arange(count)))


def test_points_of_the_view_are_those_of_the_frame_chain():
    scans, log = [scan_at(k) for k in range(40)], joints(120)
    receiving, sending = Pipe(duplex=False)
    found = []
    reader = threading.Thread(target=lambda: found.extend(growing(receiving, Placing(ANGLES, None))))
    reader.start()
    feed = Feed(sending)
    for when, angle in zip(log.time_ns.tolist(), log.position_rad.tolist(), strict=True):
        feed.joint(when, angle)
    for scan in scans:
        feed.scan(scan)
    feed.message("a line")
    feed.close()
    reader.join(120)
    expected = np.concatenate([deskew(scan, log, ANGLES) for scan in scans])
    expected = expected[np.isfinite(expected[:, 0])]
    points = np.concatenate([more.points_m for more in found])
    np.testing.assert_allclose(points, expected, atol=2e-5)
    seconds = np.concatenate([more.time_s for more in found])
    assert (seconds[0], seconds[-1]) == (0, pytest.approx(39 * 0.025))
    assert [line for more in found for line in more.lines] == ["a line"]
    assert found[-1].lost == 0
    receiving.close()


def test_a_viewer_that_sleeps_costs_the_scan_no_time_and_loses_the_oldest():
    receiving, sending = Pipe(duplex=False)
    feed = Feed(sending)
    scan = scan_at(0, beams=20_000)  # one of them fills the pipe
    for index in range(3 * MOST_SCANS):  # none of these waits for the viewer, or this would not end
        feed.scan(scan)
        feed.joint(index, 0.0)
        if index == MOST_SCANS:
            until(lambda: not feed._scans)  # the sender is in the pipe now, and stays there
    assert feed.lost > MOST_SCANS // 2
    receiving.close()
    feed.close()
    until(lambda: not feed._thread.is_alive())


def test_angles_that_come_twice_or_late_do_no_harm():
    log = joints(60)
    placing = Placing(ANGLES, None)
    first = Batch(log.time_ns[:40], log.position_rad[:40], (), (), 0)
    again = Batch(log.time_ns[30:], log.position_rad[30:], tuple(scan_at(k) for k in range(10)), (), 3)
    assert len(placing.place(first).points_m) == 0
    more = placing.place(again)
    expected = np.concatenate([deskew(scan_at(k), log, ANGLES) for k in range(10)])
    np.testing.assert_allclose(more.points_m, expected[np.isfinite(expected[:, 0])], atol=2e-5)
    assert more.lost == 3


def test_the_view_states_its_progress_and_the_unit_of_its_colours():
    points = np.outer(np.linspace(0, 1, 101), [0, 0, 3]).astype(np.float32)
    with guarded_server("a page") as (server, _):
        view = CloudView(server, "scan", np.zeros(3), 18.0)
        assert view.legend.content == ""
        view.add(CloudGrowth(points, np.zeros(101, np.float32), np.full(101, 22.5, np.float32), (), 2))
        assert "101 points; full scan 2: 25% (4.5 of 18 s); the view dropped 2 scans" in view.facts.content
        assert "0.0 m" in view.legend.content and "3.0 m" in view.legend.content
        view.by.value = "time"
        assert "22.5 s" in view.legend.content


def test_the_view_counts_what_it_shows_and_what_it_forgets(monkeypatch):
    monkeypatch.setattr(cloud_view, "CHUNK_POINTS", 500)
    monkeypatch.setattr(cloud_view, "MOST_POINTS", 2000)
    rng = np.random.default_rng(0)
    with guarded_server("a page") as (server, _):
        view = CloudView(server, "scan", np.zeros(3))
        for index in range(30):
            points = rng.normal(0, 1 + index, (100, 3)).astype(np.float32)
            view.add(CloudGrowth(points, np.zeros(100, np.float32), np.full(100, index, np.float32), (), 0))
        view.by.value = "time"
        nothing = np.empty(0, np.float32)
        view.add(CloudGrowth(nothing.reshape(0, 3), nothing, nothing, ("a line",), 7))
        shown = sum(len(chunk.points_m) for chunk in view.chunks)
        assert view.points == 3000 and shown + view.forgotten == 3000 and shown <= 2000
        colours = np.concatenate([np.asarray(chunk.handle.colors) for chunk in view.chunks])
        assert len(colours) == shown and len(np.unique(colours, axis=0)) > 10
        assert "dropped 7 scans" in view.facts.content
        kept = view.cloud()
        assert len(kept.points_m) == shown and set(kept.columns["time_s"]) == set(range(30 - shown // 100, 30))
        ranges = np.concatenate([chunk.values["range"] for chunk in view.chunks])
        np.testing.assert_allclose(ranges, np.linalg.norm(kept.points_m, axis=1), rtol=1e-6)


def summary(**more):
    values = {"recording": "r.mcap", "scans": 3, "joint_samples": 9, "duration_s": 1.0, "speed_deg_s": 20.0}
    return ScanSummary(**values | {"ripple_deg": 0.1, "clock_ns": 1000, "reconnects": 0, "left_out": {}} | more)


def noted(error, *notes):
    for note in notes:
        error.add_note(note)
    return error


OFF = "servo 1 (MX-64R) has answered that its torque is off"
TURNS = UnsafeNote("servo 1 (MX-64R): could not be stopped: cut its power (no answer)")
SHINES = UnsafeNote("its laser may still be on: no answer")
ENDS = {
    "done": (scan_end.finished(summary(left_out={BETWEEN_STOPS: 8}), ["wrote 90 points"]), "wrote 90 points"),
    "lossy": (scan_end.finished(summary(left_out={"bad packets": 12})), "dropped 12: bad packets"),
    "reconnected": (scan_end.finished(summary(reconnects=2)), "lidar reconnects: 2"),
    "failed": (
        scan_end.failed(noted(DeviceError("<b>nothing</b> came"), OFF)),
        "<b>nothing</b> came",
    ),
    "servo not stopped": (scan_end.failed(noted(DeviceError("the bus was cut"), TURNS)), TURNS),
    "servo not stopped at the end": (scan_end.failed(UnsafeError(TURNS)), TURNS),
    "laser may be on": (scan_end.failed(noted(DeviceError("the line was cut"), OFF, SHINES)), SHINES),
    "stopped": (scan_end.stopped(noted(KeyboardInterrupt(), OFF)), OFF),
    "stopped, servo turns": (scan_end.stopped(noted(KeyboardInterrupt(), TURNS)), TURNS),
    "stopped, unheard": (scan_end.stopped(KeyboardInterrupt()), "state of the servo unknown"),
}
OUTCOMES = {
    "reconnected": "lossy",
    "servo not stopped": "unsafe",
    "servo not stopped at the end": "unsafe",
    "laser may be on": "unsafe",
    "stopped, servo turns": "unsafe",
    "stopped, unheard": "unsafe",
}


@pytest.fixture(scope="module")
def shown():
    with guarded_server("a page") as (server, gate):
        yield CloudView(server, "scan", np.zeros(3)), gate


@pytest.mark.parametrize("case", ENDS)
def test_each_end_of_a_scan_reaches_the_page_in_the_words_of_the_terminal(case, shown):
    end, words = ENDS[case]
    receiving, sending = Pipe(duplex=False)
    feed = Feed(sending)
    feed.ended(end)
    feed.close()
    view, _ = shown
    for growth in growing(receiving, Placing(ANGLES, None)):
        view.add(growth)
    assert view.end.outcome == OUTCOMES.get(case, case)
    assert f'data-kind="{view.end.outcome}"' in view.banner.content
    assert escape("\n".join((end.heading, *end.lines))) in view.banner.content and words in "\n".join(end.lines)
    assert 'data-lost=""' in view.banner.content  # how it ended is known: no word of an unknown state


class Seen:
    """A `Viewer` that keeps the ends that it is given."""

    def __init__(self):
        self.ends = []

    def ended(self, end):
        self.ends.append(end)

    def close(self):
        self.ends.append("closed")


@pytest.mark.parametrize(
    ("error", "case", "code"),
    [
        (noted(DeviceError("the line was cut"), OFF, SHINES), "laser may be on", 3),
        (noted(KeyboardInterrupt(), TURNS), "stopped, servo turns", 130),
    ],
    ids=["error", "Ctrl-C"],
)
def test_a_scan_that_ends_early_says_the_same_on_the_terminal_and_to_the_page(error, case, code, monkeypatch, capsys):
    def acquire(*_):
        raise error

    seen = Seen()
    ports = SimpleNamespace(lidar="lidar", servo="servo")
    plan = SimpleNamespace(lines=list, recording=Path(__file__), angles=ANGLES, ports=ports, duration_s=None)
    plan.angles_path = Path("angles.json")
    monkeypatch.setattr("scanwright.firmware_io.scan.plan.plan_scan", lambda *_, **__: plan)
    monkeypatch.setattr("scanwright.firmware_io.scan.acquire.acquire", acquire)
    monkeypatch.setattr(devices, "_viewer", lambda *_, **__: nullcontext(seen))
    with pytest.raises(typer.Exit) as ended:
        devices.scan(Path("out"))
    said = [line.removeprefix("error: ") for line in capsys.readouterr().err.splitlines()]
    assert ended.value.exit_code == code
    assert said == [*ENDS[case][0].lines, f"what was recorded is in {__file__}"]
    (end, closed) = seen.ends
    assert (list(end.lines), end.outcome, closed) == (said, "unsafe", "closed")


GREEN, AMBER, RED, GREY = "rgb(27, 94, 32)", "rgb(255, 197, 61)", "rgb(165, 17, 17)", "rgb(52, 58, 64)"
BANNERS = {
    "done": GREEN,
    "lossy": AMBER,
    "failed": RED,
    "servo not stopped": RED,
    "laser may be on": RED,
    "stopped": GREY,
}


def test_in_a_browser_each_state_is_shown_and_keeps_nobody_out(browser):
    """Waiting, scanning, each end as an alert that stays, and a program that is lost; each size in light and dark."""
    sizes = itertools.cycle([(1440, 900), (720, 450), (390, 844)])
    points, nothing = np.zeros((1234, 3), np.float32), np.zeros(1234, np.float32)
    with guarded_server("a page") as (server, gate):
        view = CloudView(server, "hall", np.zeros(3), 18.0)
        light, dark = (
            browser.open(gate.address, 900, 600, 300, device_scale_factor=0.5, color_scheme=scheme)
            for scheme in ("light", "dark")
        )
        for page in (light, dark):
            page.get_by_text("waiting for the first scan").wait_for()
            assert not page.locator(".sw-banner[role=alert]").is_visible() and browser.barriers(page) == []
        view.add(CloudGrowth(points, nothing, np.full(1234, 4.5, np.float32), (), 0))
        light.get_by_text("1,234 points; full scan 1: 25%").wait_for()
        assert browser.barriers(light) == []
        for (case, colour), page in zip(BANNERS.items(), itertools.cycle((light, dark)), strict=False):
            width, height = next(sizes)
            page.set_viewport_size({"width": width, "height": height})
            end, _ = ENDS[case]
            view.show_end(end)
            shown = "text => document.querySelector('.sw-banner[role=alert]')?.textContent.trimEnd() === text"
            page.wait_for_function(shown, arg="\n".join([end.heading, *end.lines]))  # ends have words in common
            banner = page.locator(".sw-banner[role=alert]")
            banner.wait_for()
            assert banner.evaluate("e => getComputedStyle(e).backgroundColor") == colour
            box = banner.bounding_box()
            at = (box["x"] + 20, box["y"] + 20)
            assert page.evaluate("([x, y]) => document.elementFromPoint(x, y).className", at) == "sw-banner"
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            assert browser.barriers(page) == []
        later = browser.open(gate.address, 900, 600, 300, device_scale_factor=0.5)
        later.locator(".sw-banner").filter(has_text=ENDS["stopped"][1]).wait_for()
        view.banner.content = CloudView(server, "next", np.zeros(3)).banner.content  # a new scan begins
        banner = light.locator(".sw-banner[role=alert]")
        banner.wait_for(state="hidden")
        server.stop()
        banner.filter(has_text="the state of the devices is unknown").wait_for()
        assert banner.get_attribute("data-kind") == "lost"
    browser.complaints[:] = [said for said in browser.complaints if "ERR_CONNECTION_REFUSED" not in said]
    browser.complaints[:] = [said for said in browser.complaints if not any(word in said for word in HARMLESS)]


def test_the_first_points_of_a_chunk_are_all_of_them_thinned():
    height = np.linspace(-1, 1, 5000, dtype=np.float32)
    points, nothing = np.stack([0 * height, 0 * height, height], axis=1), np.zeros(5000, np.float32)
    with guarded_server("a page") as (server, _):
        view = CloudView(server, "scan", np.zeros(3))
        for part in range(0, 5000, 1000):  # as they come: from below to above
            some = slice(part, part + 1000)
            view.add(CloudGrowth(points[some], nothing[some], nothing[some], (), 0))
        sent = view.chunks[0].handle
        np.testing.assert_array_equal(np.sort(sent.points[:, 2]), height)
        assert kstest(sent.points[:250, 2], "uniform", (-1, 2)).pvalue > 1e-3
        by_height = np.argsort(sent.points[:, 2])
        assert (np.diff(sent.colors[by_height, 0].astype(int)) >= 0).all()  # each has its own colour, dark to bright
        np.testing.assert_array_equal(view.cloud().points_m, points)


def test_the_address_is_said_and_the_page_seen_before_the_scan_begins(tmp_path, capsys):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    opened = []

    def browse(address):
        opened.append(address)
        path = address.removeprefix("http://127.0.0.1:").split("/", 1)
        port, token = int(path[0]), path[1]
        headers = {"Cookie": f"scanwright-{port}={token.removeprefix('?token=')}"}
        origin = f"http://127.0.0.1:{port}"
        looking.append(connect(f"ws://127.0.0.1:{port}/", origin=origin, additional_headers=headers))
        return True

    looking = []
    with live_page(tmp_path, wanted=True, browse=browse) as watch:
        assert capsys.readouterr().out == f"open {opened[0]}\n" and looking
        watch.scan(scan_at(0))
        watch.ended(ENDS["done"][0])
        watch.close()
        looking[0].close()


def test_a_scan_program_that_goes_away_leaves_an_unknown_state_on_the_page(monkeypatch, tmp_path):
    (tmp_path / "angles.json").write_text(ANGLES.to_json())
    shown = []
    monkeypatch.setattr(CloudView, "show_end", lambda _, end: shown.append(end))
    monkeypatch.setattr(scan_page.signal, "signal", lambda *_: None)
    receiving, sending = Pipe(duplex=False)
    hearing, telling = Pipe(duplex=False)
    os.write(sending.fileno(), b"\0\0")  # the program is killed within a message
    sending.close()
    scan_page._show(receiving, telling, tmp_path)
    assert shown == [scan_end.LOST] and hearing.recv().startswith("http://127.0.0.1:")


def test_a_page_that_cannot_be_served_is_one_line(tmp_path):
    with pytest.raises(ScanwrightError, match="the page could not be served"), live_page(tmp_path, wanted=True):
        pytest.fail("there are no angles in that folder")


def test_the_ceiling_is_cut_away_and_stays_away():
    height = np.linspace(-1, 1, 1001, dtype=np.float32)
    points, nothing = np.outer(height, [0, 0, 1]).astype(np.float32), np.zeros(1001, np.float32)
    with guarded_server("a page") as (server, _):
        view = CloudView(server, "scan", np.zeros(3))
        view.add(CloudGrowth(points, nothing, nothing, (), 0))
        view.cut.value = 1.5
        assert view.chunks[0].handle.points[:, 2].max() == 0.5 and len(view.cloud().points_m) == 1001
        view.by.value = "range"
        view.add(CloudGrowth(points, nothing, nothing, (), 0))
        handle = view.chunks[0].handle
        assert len(handle.points) == len(handle.colors) == 2 * 751
        assert "range: 0.0 m" in view.page() and "1,502 of 1,502 points" in view.page()


def test_the_expected_density_lies_in_the_room_about_the_scanner(tmp_path, cheapest_task):
    (tmp_path / "task.toml").write_text(cheapest_task)
    loaded = load_task(tmp_path / "task.toml")
    angles = loaded.angle_set((0, 0, 0, -60)).model_copy(update={"t_world_rot_mm": (100.0, 0.0, 300.0)})
    (tmp_path / "angles.json").write_text(angles.to_json())
    with guarded_server("a page") as (server, _):
        view = CloudView(server, "scan", angles.T_world_rot(0.0)[:3, 3])
        scan_page._expect(view, tmp_path, angles)
        np.testing.assert_allclose(view._walls.frame.position, [0.1, 0, 0.3])
        pictures = [wall.handle for wall in view._walls.walls]
        *_, floor, ceiling = pictures
        assert floor.position[2] == pytest.approx(-1.0)
        rows, columns = ceiling.image.shape[:2]
        assert ceiling.image[rows // 2, columns // 2, 3] == 0  # the task looks to the sides
        shown = [wall.image[..., :3][wall.image[..., 3] > 0] for wall in pictures]
        assert len(np.unique(np.concatenate(shown), axis=0)) > 2
        view._expected.value = False
        assert not view._walls.frame.visible


def test_the_ruler_takes_the_point_that_is_meant():
    rng = np.random.default_rng(0)
    wall = np.stack([np.full(5000, 4.0), *rng.uniform(-2, 2, (2, 5000))], axis=1).astype(np.float32)
    behind = wall + np.float32([2.0, 0, 0])
    for aim in ([4.0, 0.3, 0.2], [4.0, -1.5, 1.0]):
        found = nearest_to_ray([behind, wall], np.zeros(3), np.array(aim) * 3)
        assert found[0] == 4.0 and np.linalg.norm(found - aim) < 0.08
    assert nearest_to_ray([wall], np.zeros(3), np.array([-1.0, 0, 0])) is None
    assert nearest_to_ray([], np.zeros(3), np.array([1.0, 0, 0])) is None


def test_two_clicks_are_a_length_and_a_third_begins_anew():
    points = np.array([[4, 0, 0], [4, 3, 0], [4, 0, 1]], np.float32)
    with guarded_server("a page") as (server, _):
        ruler = Ruler(server, lambda: [points])
        ruler.click(np.zeros(3), np.array([1.0, 0, 0]))
        assert ruler.text == ""
        ruler.click(np.zeros(3), np.array([0.0, 0, -1]))  # at nothing
        ruler.click(np.zeros(3), np.array([4.0, 3, 0]))
        assert ruler.text == "3.000 m"
        ruler.click(np.zeros(3), np.array([4.0, 0, 1]))
        assert ruler.text == ""


def test_in_a_browser_a_distance_is_measured_and_the_cloud_saved(browser, tmp_path):
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(-3, 3, (20_000, 2)), np.full(20_000, -1.0)]).astype(np.float32)
    with guarded_server("a page") as (server, gate):
        view = CloudView(server, "hall", np.zeros(3), 18.0)  # with a bar of progress
        nothing = np.zeros(len(floor), np.float32)
        view.add(CloudGrowth(floor, nothing, nothing, (), 0))
        small = {"width": 900, "height": 600, "device_scale_factor": 0.5}  # drawn on the processor here
        page = browser.open(gate.address, **small, color_scheme="dark")
        assert page.title() == "a page"
        page.get_by_text("20,000 points").wait_for()
        assert browser.barriers(page) == []
        page.get_by_label("measure").check()
        until(lambda: view.ruler.on.value)
        for number, across in enumerate((350, 550), 1):
            for _ in range(10):  # a page that does not know yet that it takes clicks misses one
                if len(view.ruler.ends) >= number:
                    break
                page.mouse.move(across, 380)
                page.mouse.down()
                page.wait_for_timeout(50)
                page.mouse.up()
                with suppress(AssertionError):
                    until(lambda number=number: len(view.ruler.ends) == number, 3)
        assert re.fullmatch(r"\d\.\d{3} m", view.ruler.text)
        with page.expect_download() as download:
            page.get_by_role("button", name="Save as PLY").click()
        assert download.value.suggested_filename == "hall.ply"
        download.value.save_as(tmp_path / "hall.ply")
        (cloud,), _ = read_clouds(tmp_path / "hall.ply")
        np.testing.assert_array_equal(cloud.points_m, floor)
        with page.expect_download() as download:
            page.get_by_role("button", name="Save as web page").click()
        download.value.save_as(tmp_path / download.value.suggested_filename)
    saved = browser.open((tmp_path / "hall.html").as_uri(), 900, 600)
    saved.locator("#canvas").press("ArrowLeft")
    assert "20,000 of 20,000 points" in saved.inner_text("main") and browser.barriers(saved) == []
    shot = np.asarray(Image.open(io.BytesIO(saved.locator("#canvas").screenshot())).convert("RGB"), int)
    assert (np.abs(shot - COLOUR_STOPS[0]).max(axis=2) < 9).mean() > 0.02  # a floor has one height
    browser.complaints[:] = [said for said in browser.complaints if not any(word in said for word in HARMLESS)]


SLOWLY = """async () => {
  const { cameraControl, requestRender } = window.__viserMutable;
  let fewest = Infinity;
  for (let k = 0; k < 30; k++) {
    cameraControl.rotate(0.02, 0, false);
    requestRender();
    const now = await new Promise(requestAnimationFrame);
    while (performance.now() < now + 80);
    fewest = Math.min(fewest, window.__viserTestpoints.rendererInfo.render.points);
  }
  return fewest;
}"""


def test_a_computer_that_draws_slowly_draws_fewer_points_while_the_view_moves_and_all_of_them_at_rest(browser):
    rng = np.random.default_rng(0)
    with guarded_server("a page") as (server, gate):
        view = CloudView(server, "hall", np.zeros(3))
        nothing = np.zeros(60_000, np.float32)
        for _ in range(2):
            view.add(CloudGrowth(rng.uniform(-3, 3, (60_000, 3)).astype(np.float32), nothing, nothing, (), 0))
        page = browser.open(gate.address, width=900, height=600, device_scale_factor=0.5)
        drawn = "window.__viserTestpoints?.rendererInfo.render.points"
        page.wait_for_function(f"{drawn} === 120_000")
        assert 20_000 <= page.evaluate(SLOWLY) < 40_000
        page.wait_for_function(f"{drawn} === 120_000")
    browser.complaints[:] = [said for said in browser.complaints if not any(word in said for word in HARMLESS)]
