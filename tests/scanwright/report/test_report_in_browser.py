"""The report in a browser: whole without a network, every control does what it says, nobody is kept out."""

import io
import itertools
import re

import numpy as np
import pytest
from PIL import Image
from report_folder import cell, picture, scene_of


def shot_of(page, selector):
    """Colours of what is shown, 0 to 1, once the page has drawn what it was asked for."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return np.asarray(Image.open(io.BytesIO(page.locator(selector).screenshot())).convert("RGB"), float) / 255


def lilac(shot):
    """Where the bodies of the fixture are: red and blue are well above green there, not so in the fan."""
    return (shot[:, :, 2] - shot[:, :, 1] > 0.25) & (shot[:, :, 0] - shot[:, :, 1] > 0.1)


def changed(one, other):
    """Whether two pictures show different things: more than a pixel of an edge here and there."""
    return (np.abs(one - other).max(axis=2) > 0.1).mean() > 2e-3


def until(page, condition):
    """Wait for a condition in JavaScript; Playwright's own way needs `eval`, which the page forbids."""
    look = f"const look = () => ({condition}) ? done(true) : requestAnimationFrame(look)"
    late = "setTimeout(() => done(false), 60000)"
    assert page.evaluate(f"() => new Promise((done) => {{ {look}; {late}; look(); }})"), condition


@pytest.fixture
def shown(browser, folder):
    """The report, wide."""
    return browser.open((folder / "report.html").as_uri())


def test_the_page_is_whole_with_the_network_off(shown):
    """And the console is silent, nothing is asked of anybody: the fixture holds that for every test with it."""
    sizes = shown.evaluate(
        "Promise.all([...document.querySelectorAll('img[src]')].map((i) => i.decode().then(() => i.naturalWidth)))"
    )
    assert len(sizes) >= 11 and min(sizes) > 0
    assert not shown.is_visible("#stills") and shown.is_visible("#drawn")
    assert shown.evaluate("document.documentElement.scrollWidth") <= 1400
    scanner = shot_of(shown, "#canvas")
    assert lilac(scanner).mean() > 0.01
    for key in ("ArrowLeft", "ArrowRight"):  # a second picture is no worse than the first one
        shown.locator("#canvas").press(key)
    inside = slice(5, -5), slice(5, -5)  # of the frame that has the focus now
    assert not changed(shot_of(shown, "#canvas")[inside], scanner[inside])


def test_every_control_of_the_scanner_does_what_it_says(shown):
    shown.uncheck("#fan")
    start = shot_of(shown, "#canvas")
    area = lilac(start).sum()

    def middle(shot):
        return np.argwhere(lilac(shot)).mean(axis=0)

    shown.locator("#axis").fill("90")
    turned = shot_of(shown, "#canvas")
    assert changed(turned, start) and shown.inner_text("#axis-shown") == "90.0 deg"
    shown.locator("#axis").fill("0")
    assert not changed(shot_of(shown, "#canvas"), start)
    shown.locator("#apart").fill("1")
    apart = shot_of(shown, "#canvas")
    assert changed(apart, start) and 0.1 * area < lilac(apart).sum()
    shown.locator("#apart").fill("0")
    assert not changed(shot_of(shown, "#canvas"), start)
    shown.click("#nearer")
    assert lilac(shot_of(shown, "#canvas")).sum() > 1.1 * area
    shown.click("#farther")
    assert not changed(shot_of(shown, "#canvas"), start)
    shown.check("#fan")
    fan = shot_of(shown, "#canvas")
    ground = np.median(fan.reshape(-1, 3), axis=0)
    over, black = 0.6 * ground + 0.4 * np.array([0.95, 0.7, 0.1]), 0.15 * ground
    light, dark = (np.abs(fan - colour).max(axis=2) < 0.02 for colour in (over, black))
    assert light.mean() > 0.015 and 0.02 < light.sum() / dark.sum() and dark.sum() > 100
    for axis, count in (("89.5", 200), ("90", 100), ("359.5", 100), ("0", 200)):
        shown.locator("#axis").fill(axis)
        until(shown, f"document.getElementById('fan-shown').textContent == '{count} of 1081 beams hidden'")
    box = shown.locator("#canvas").bounding_box()
    shown.mouse.move(box["x"] + 300, box["y"] + 300)
    shown.mouse.down()
    shown.mouse.move(box["x"] + 400, box["y"] + 250)
    shown.mouse.up()
    assert changed(shot_of(shown, "#canvas"), fan)
    assert np.abs(middle(shot_of(shown, "#canvas")) - middle(fan)).max() > 1


def test_the_axis_spins_as_fast_as_in_a_scan(shown):
    shown.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    shown.evaluate(
        """() => {
            const waiting = [];
            window.requestAnimationFrame = (draw) => waiting.push(draw);
            window.framesUntil = (fromMs, toMs) => {
                for (let ms = fromMs; ms <= toMs; ms += 500) waiting.splice(0).forEach((draw) => draw(ms));
                return Number(document.getElementById("axis").dataset.exact);
            };
        }"""
    )  # time passes as this test says; few frames, since a graphics process without a card draws each one, on and on
    press = "document.getElementById('spin').click()"
    shown.evaluate(press)
    start = shown.evaluate("framesUntil(1000, 1500)")
    assert shown.evaluate("framesUntil(2000, 4500)") - start == pytest.approx(3 * 360 / 18, abs=1e-6)
    assert 0 < shown.evaluate("framesUntil(5000, 19500)") < 20  # round once
    shown.evaluate(press)
    assert shown.get_attribute("#spin", "aria-pressed") == "false"


def test_a_check_shows_where(shown):
    shown.uncheck("#fan")
    both = lilac(shot_of(shown, "#canvas")).sum()
    shown.locator("#checks .warning button").click()
    assert shown.inner_text("#picked-shown") == "base_mount"
    one = shot_of(shown, "#canvas")
    assert 0.1 * both < lilac(one).sum() < 0.9 * both
    shown.locator("#checks .error button").click()
    assert lilac(shot_of(shown, "#canvas")).sum() == pytest.approx(both, rel=0.02)
    shown.locator("#checks .warning button").click()
    shown.click("#everything")
    assert lilac(shot_of(shown, "#canvas")).sum() == pytest.approx(both, rel=0.02)
    assert not shown.is_visible("#picked")


def placed(scene, point, shape):
    """Column and row of a point of the room in the picture of the room, by another way than the page."""
    low, high = (np.array(scene["room"][end]) for end in ("low", "high"))
    yaw, pitch = scene["look"]["yaw"], scene["look"]["pitch"]
    back = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
    right = np.array([-np.sin(yaw), np.cos(yaw), 0])
    half = np.tan(np.radians(15))
    eye = (low + high) / 2 + 0.47 * np.linalg.norm(high - low) / np.sin(np.radians(15)) / 0.88 * back
    x, y, z = np.array([right, np.cross(back, right), back]) @ (point - eye)
    height, width = shape[:2]
    return int(width / 2 + height / 2 * x / -z / half), int(height / 2 * (1.12 - y / -z / half))


def test_the_room_has_the_colours_of_the_map(shown, text):
    """Every point of its walls shows what the map has in its direction."""
    scene = scene_of(text)
    shown.check("#view-room", force=True)
    seen = []
    for number in range(4):
        shown.select_option("#map-choice", str(number))
        until(shown, f"document.getElementById('canvas').dataset.map == '{number}'")
        shot = shot_of(shown, "#canvas")
        chosen = picture(shown.get_attribute(f"#map-{number}", "src"))
        centre = np.array(scene["centre"])
        low, high = np.array(scene["room"]["low"]), np.array(scene["room"]["high"])
        for point in ((0.4, 1.5, low[2]), (0.6, -1.4, low[2]), (high[0], -0.7, -0.3)):
            point = np.array([*(centre[:2] + point[:2]), point[2]]) if point[2] == low[2] else np.array(point)
            column, row = cell(point - centre)
            near = (
                np.asarray(chosen.crop((column - 1, row - 1, column + 2, row + 2)), float) / 255
            )  # a band may end here
            x, y = placed(scene, point, shot.shape)
            assert np.abs(near - shot[y, x]).max(axis=2).min() < 0.05, (number, point)
        seen.append(shot)
    assert all(changed(*pair) for pair in itertools.pairwise(seen))  # the first is rolling behind its parts
    shown.locator("#canvas").press("ArrowUp")
    assert changed(shot_of(shown, "#canvas"), seen[3])
    shown.click("#fit")
    assert not changed(shot_of(shown, "#canvas"), seen[3])


def test_one_scan_is_a_cloud_with_a_legend(shown, text):
    scene = scene_of(text)
    shown.check("#view-scan", force=True)
    shot = shot_of(shown, "#canvas")
    stops = np.array(scene["stops"]) / 255
    assert all((np.abs(shot - stop).max(axis=2) < 0.03).any() for stop in stops[[0, -1]])
    words = " ".join(shown.locator(".tools:visible").all_inner_texts())
    assert (
        all(height in words for height in scene["heights"])
        and f"{scene['shown']:,} of {scene['cast']:,} beams" in words
    )
    assert 20_000 < scene["shown"] < 90_000


def test_parts_have_names_a_click_selects_one_and_the_cut_opens_them(shown):
    shown.uncheck("#fan")
    assert {"lidar", "mount", "ahead"} <= set(shown.locator(".mark:visible").all_inner_texts())
    whole = shot_of(shown, "#canvas")
    row, column = np.argwhere(lilac(whole)).mean(axis=0)
    rows, columns = np.nonzero(lilac(whole))
    at = np.argmin(np.hypot(rows - row, columns - column))
    place = {"x": float(columns[at]), "y": float(rows[at])}
    shown.hover("#canvas", position=place)
    name = shown.inner_text("#tip")
    assert name in ("base mount", "lidar body")
    shown.click("#canvas", position=place)
    assert shown.inner_text("#picked-shown") == name.replace(" ", "_")
    assert lilac(shot_of(shown, "#canvas")).sum() < 0.9 * lilac(whole).sum()
    shown.click("#everything")
    shown.mouse.move(5, 5)
    assert not changed(shot_of(shown, "#canvas"), whole)
    shown.locator("#cut").fill("0.98")
    assert changed(shot_of(shown, "#canvas"), whole)


def test_a_phone_needs_no_sideways_scroll(browser, folder):
    page = browser.open((folder / "report.html").as_uri(), 390, 844, device_scale_factor=2, has_touch=True)
    page.evaluate("document.querySelectorAll('details').forEach((details) => (details.open = true))")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    heights = "[...document.querySelectorAll('#place .mark')].map((mark) => mark.offsetHeight)"
    assert len(set(page.evaluate(heights)) - {0}) == 1  # no name is broken at the edge
    assert lilac(shot_of(page, "#canvas")).mean() > 0.01
    small = page.evaluate(
        "[...document.querySelectorAll('p, td, dd, dt, li, summary, label, button')]"
        ".filter((e) => parseFloat(getComputedStyle(e).fontSize) < 12).length"
    )
    assert small == 0


@pytest.mark.parametrize(
    ("size", "scheme"), [((1440, 900), "light"), ((720, 450), "dark"), ((390, 844), "light"), ((390, 844), "dark")]
)
def test_the_page_is_open_to_everybody(browser, folder, size, scheme):
    page = browser.open((folder / "report.html").as_uri(), *size, color_scheme=scheme)
    page.evaluate("document.querySelectorAll('details').forEach((details) => (details.open = true))")
    assert browser.barriers(page) == []
    assert page.evaluate("document.documentElement.scrollWidth") == size[0]


def test_the_first_screen_answers_in_at_most_200_words(browser, folder):
    page = browser.open((folder / "report.html").as_uri(), 1440, 900)
    seen = page.evaluate(
        """[...document.querySelectorAll("body *:not(script, style, option, .visually-hidden)")].filter((e) => {
            const { top, height } = e.getBoundingClientRect();
            return height > 0 && top < innerHeight;
        }).flatMap((e) => [...e.childNodes].filter((n) => n.nodeType === 3).map((n) => n.textContent)).join(" ")"""
    )
    assert 60 < len(seen.split()) <= 200
    for card in ("What it sees", "Compared with usual mounts", "One scan", "To make it"):
        assert card in seen
    assert page.evaluate("[...document.querySelectorAll('.fact')].every((e) => e.getBoundingClientRect().bottom < 900)")


def test_ticks_stay(shown):
    shown.check("#do .tick input >> nth=1", force=True)
    shown.reload()
    assert shown.locator("#do .tick input").evaluate_all("all => all.map((each) => each.checked)")[:3] == [
        False,
        True,
        False,
    ]


def test_the_assembly_turns_its_pages(browser, folder, tmp_path):
    text = (folder / "report.html").read_text(encoding="utf-8")
    step = re.search(r'<li class="step" id="step-1">.*?</li>\n', text, re.DOTALL)[0]
    (tmp_path / "two.html").write_text(text.replace(step, step + step.replace("step-1", "step-2")))
    page = browser.open((tmp_path / "two.html").as_uri())
    for press, at in (("#next", 2), ("#back", 1)):
        page.click(press)
        assert page.inner_text("#at-step") == f"{at} of 2"
        assert [page.is_visible(f"#step-{n}") for n in (1, 2)] == [at == 1, at == 2]
    assert page.is_disabled("#back") and not page.is_disabled("#next")
    page.evaluate("location.hash = '#step-2'")
    until(page, "!document.getElementById('step-2').hidden")


def test_on_paper_nothing_is_folded_and_no_control_is_left(shown):
    shown.evaluate(
        "window.onbeforeprint = () => (window.printed = document.querySelectorAll('details:not([open])').length)"
    )
    content = shown.pdf(format="A4")
    assert content.startswith(b"%PDF") and 3 <= content.count(b"/Type /Page\n") <= 8
    assert shown.evaluate("window.printed") == shown.locator("details.screen").count()
    assert shown.locator("details[open]").count() == 1  # devices, as before
    shown.emulate_media(media="print")
    for selector in ("#spin", "#map-choice", ".tabs", ".zoom", "nav", ".pager"):
        assert not shown.is_visible(selector)
    for selector in ("#canvas", "#stills figure >> nth=1", ".fact", ".step"):
        assert shown.locator(selector).first.is_visible()
    assert lilac(shot_of(shown, "#canvas")).mean() > 0.005


def test_without_webgl_still_pictures_are_there(browser, folder):
    page = browser.open("about:blank")
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto((folder / "report.html").as_uri())
    assert page.locator("#stills img:visible").count() == 2 and not page.is_visible("canvas")
    assert page.locator("#checks button:disabled").count() == page.locator("#checks button").count() > 0


def test_without_scripts_all_of_it_is_there(browser, folder):
    page = browser.open((folder / "report.html").as_uri(), java_script_enabled=False)
    assert page.locator("#stills img:visible").count() == 2
    assert not page.is_visible(".pager") and not page.is_visible("canvas")
    assert all(step.is_visible() for step in page.locator(".step").all())


def test_the_browser_tests_would_see_a_request(browser, tmp_path):
    leaky = tmp_path / "leaky.html"
    leaky.write_text("<img src='http://192.0.2.1/x.png'><script>console.error('oh')</script>")
    browser.open(leaky.as_uri())
    assert "asked the network for http://192.0.2.1/x.png" in browser.complaints and "oh" in browser.complaints
    browser.complaints.clear()
