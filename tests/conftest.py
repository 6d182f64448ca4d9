"""What several test files share."""

import gc
import json
import os
import shutil
import signal
import sys
from pathlib import Path
from types import SimpleNamespace

import jsonschema
import pytest
from hypothesis import settings

if sys.dont_write_bytecode:  # out of the checkout, then: else every worker and every command compiles all it imports
    sys.dont_write_bytecode = False
    sys.pycache_prefix = str(Path(__file__).parents[1] / ".pytest_cache" / "pycache")
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
os.environ.pop("COLUMNS", None)  # results would be wrapped, also in files
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # workers and what they start share the cores: threads would wait

sys.path.insert(0, str(Path(__file__).parent / "house" / "virtual"))
sys.path.insert(0, str(Path(__file__).parent / "house"))
sys.path.insert(0, str(Path(__file__).parent / "house" / "virtual"))
import checked_arrays
import quick_tests
from made_once import MadeOnce

checked_arrays.install()

# CI judges the change, not the dice; at a developer's desk every run draws new examples. Cores are shared everywhere.
settings.register_profile("ci", derandomize=True, deadline=None, max_examples=40)
settings.register_profile("desk", deadline=None, max_examples=40)
settings.load_profile("ci" if os.environ.get("CI") else "desk")

# what a shell starts in the background ignores Ctrl-C, and so would every process that a test starts and ends with it
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    parser.addoption("--measure-slow", action="store_true", help="list anew which tests are slow: all of them must run")
    parser.addoption("--every-sample", action="store_true", help="the samples too that only repeat what others show")


def pytest_configure(config):
    if config.getoption("--every-sample"):
        settings.register_profile("every sample", settings(), max_examples=100)
        settings.load_profile("every sample")
    if config.getoption("--measure-slow"):
        config.pluginmanager.register(quick_tests.Stopwatch(hasattr(config, "workerinput")))


def pytest_collection_modifyitems(config, items):
    quick_tests.mark(items)
    if not config.getoption("--every-sample"):
        quick_tests.leave_out_samples(config, items)


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    gc.disable()  # what is loaded here stays, and to look through it again and again takes a third of the time
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(autouse=True)
def _arrays_are_checked_anew():
    checked_arrays.begin()


@pytest.fixture(scope="session")
def data() -> Path:
    """Folder of real recordings, from the environment variable SCANWRIGHT_DATA."""
    folder = os.environ.get("SCANWRIGHT_DATA")
    if not folder:
        pytest.skip("SCANWRIGHT_DATA is not set: it names the folder of real recordings")
    return Path(folder)


SMALL = """
name = "small"
sensor = "UTM-30LX"
servo = "MX-64R"
slip_ring = "SNU11-P0210"
[motion]
period_s = 2.0
[angles]
step_deg = 15.0
[[weight]]
shape = "cone"
axis = [1, 0, -1]
half_angle_deg = 40
[[mask]]
shape = "cone"
axis = [-1, 0, 0]
half_angle_deg = 20
"""
CHEAPEST = """
name = "ahead"
sensor = "URG-04LX"
servo = "AX-12A"
[motion]
mode = "sweep"
limits_deg = [-90, 90]
period_s = 12.0
accel_deg_s2 = 200.0
[angles]
alpha_rot_deg = 0
beta_rot_deg = 0
alpha_laser_deg = 0
beta_laser_deg = -60
[density]
ball_radius_deg = 3.0
tolerance = 0.01
[[weight]]
shape = "band"
theta_deg = [45, 135]
"""


@pytest.fixture(scope="session")
def small_task() -> str:
    """A task file whose J is quick: coarse steps, a cone that matters, and one that is masked."""
    return SMALL


@pytest.fixture(scope="session")
def cheapest_task() -> str:
    """The task file that takes least to build: all angles given, few parts, a wide ball."""
    return CHEAPEST


def require_documented(command, text):
    """Raise if a text is no JSON object as the schema of the command describes it, further keys excluded."""
    from scanwright.cli.results.schemas import result_schema

    schema = result_schema(command)
    for record in (schema, *schema.get("$defs", {}).values()):
        if "properties" in record:
            record["additionalProperties"] = False
    jsonschema.validate(json.loads(text), schema, jsonschema.Draft202012Validator)


@pytest.fixture
def command(monkeypatch, capsys):
    """Run a command as its user would: exit code, what it printed, and the lines of complaint (progress left out)."""

    from scanwright.cli.app import run as scanwright_command

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["scanwright", *map(str, words)])
        try:
            scanwright_command()
            code = 0
        except SystemExit as stop:
            code = stop.code or 0
        printed = capsys.readouterr()
        if "--json" in words and code in (0, 1):
            require_documented(words[0], printed.out)
        return code, printed.out, [line for line in printed.err.splitlines() if not line.startswith("  ..")]

    return run


CHROMIUM = [
    "--no-sandbox",  # it refuses to run as root otherwise
    "--use-angle=swiftshader",  # WebGL 2 without a graphics card
    "--enable-unsafe-swiftshader",
    "--disable-gpu-rasterization",  # text and panels cost a third as much without that card's stand-in
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
]
NOT_OURS = (  # the page server's own drawing library says so
    "THREE.Clock: This module has been deprecated",
    "KHR_parallel_shader_compile",  # which drawing without a graphics card does not offer
    "glDrawElementsInstanced: Vertex shader input type does not match",  # of one frame, when it changes tiles
)
SLOW_FRAMES = """
window.requestAnimationFrame = (step) => setTimeout(() => step(performance.now()), %d);
window.cancelAnimationFrame = clearTimeout;
"""
AT_HOME = ("file://", "data:", "blob:", "about:", "http://127.0.0.1:", "ws://127.0.0.1:")


class Browser:
    """Chromium with the network off but for 127.0.0.1; what a page asks of anybody else, or complains of, is kept.

    Attributes:
        complaints: errors and warnings of the console, uncaught errors, dialogs, and requests that leave the machine.
    """

    def __init__(self, chromium):
        self.chromium = chromium
        self.complaints = []

    def open(self, address, width=1400, height=900, frame_ms=None, **options):
        """A page of its own, with nothing kept from another one, once it has loaded; options as Playwright has them.

        `frame_ms` is for a page that draws all the time, which would take a core for as long as it is open.
        """
        page = self.chromium.new_context(viewport={"width": width, "height": height}, **options).new_page()
        if frame_ms:
            page.add_init_script(SLOW_FRAMES % frame_ms)
        page.set_default_timeout(60_000)  # for a machine that has much else to do
        page.on("console", lambda said: self._said(said.type, said.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", lambda asked: self._seen(asked.url))
        page.on("dialog", self._asked)
        page.on("websocket", lambda asked: self._seen(asked.url))
        page.goto(address)
        return page

    def barriers(self, page):
        """What axe-core finds that keeps somebody out: a line for each rule and element."""
        from axe_playwright_python.sync_playwright import Axe

        found = Axe().run(page).response["violations"]
        return [f"{rule['id']}: {node['html'][:160]}" for rule in found for node in rule["nodes"]]

    def _said(self, kind, text):
        if kind in ("error", "warning") and not any(words in text for words in NOT_OURS):
            self.complaints.append(text)

    def _asked(self, dialog):
        self.complaints.append(f"asked the person: {dialog.message}")
        dialog.dismiss()

    def _seen(self, url):
        if not url.startswith(AT_HOME):
            self.complaints.append(f"asked the network for {url[:200]}")


@pytest.fixture(scope="module")  # not longer: while it is open its thread has a running event loop
def chromium():
    """Chromium without a screen; tests that need it are skipped on a machine without it."""
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("chromium is not installed (apt-get install chromium): pages are not driven in a browser")
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=program, args=CHROMIUM)
        yield started
        started.close()


@pytest.fixture
def browser(chromium):
    """A `Browser`; the test fails when a page of it complained (a test that means to provoke it clears the list)."""
    browser = Browser(chromium)
    yield browser
    for context in chromium.contexts:
        context.close()
    assert browser.complaints == []


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """Makes what is dear once for all workers: `MadeOnce`."""
    folder = tmp_path_factory.getbasetemp()  # of this worker alone, where there are several
    return MadeOnce(folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder)


@pytest.fixture(scope="session")
def parts_of(once):
    """Of a scanner, all its parts and the bodies around them: made once, for reading only."""
    from scanwright.cad.assembly.make import make_parts

    return lambda scanner: once(f"parts {scanner}", lambda _: make_parts(scanner))


@pytest.fixture(scope="session")
def optimum_ahead(once):
    """The optimum of the shipped task `ground_ahead`: for reading only."""
    from scanwright.design.progress import no_progress
    from scanwright.design.search.optimum import find_optimum
    from scanwright.design.task.task import load_task

    return once("optimum of ground_ahead", lambda _: find_optimum(load_task(Path("ground_ahead")), no_progress))


TILTED = """
name = "tilted"
sensor = "UTM-30LX"
servo = "MX-64R"
slip_ring = "SNU11-P0210"
printer = "fdm-0.4"
[motion]
period_s = 18.0
[angles]
alpha_rot_deg = 0
beta_rot_deg = 35
alpha_laser_deg = -20
beta_laser_deg = -70
[[weight]]
shape = "all"
"""


@pytest.fixture(scope="session")
def made(once):
    """The build of one tilted scanner, which has a bearing.

    Its folder, what was made and exported, the scanner, and what the command prints: for reading only.
    """
    from scanwright.api import build
    from scanwright.cad.files import workshop_files
    from scanwright.design.concurrency import processes
    from scanwright.pipeline import build as pipeline

    def all_of_it(folder):
        given = {}

        def keeping(function):
            def kept(scanner, *words):
                given["scanner"], given[function.__name__] = scanner, function(scanner, *words)
                return given[function.__name__]

            return kept

        folder.mkdir()
        (folder / "tilted.toml").write_text(TILTED)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(processes, "cores", lambda: 1)  # all of it here
            patch.setattr(pipeline, "build_parts", keeping(pipeline.build_parts))
            patch.setattr(workshop_files, "export_scanner", keeping(workshop_files.export_scanner))
            built = build(folder / "tilted.toml", folder / "out")
        result, exports = given["build_parts"], given["export_scanner"]
        return SimpleNamespace(
            folder=built.folder, result=result, exports=exports, scanner=given["scanner"], lines=built.lines()
        )

    return once("the tilted scanner", all_of_it)
