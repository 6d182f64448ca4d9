"""The screenshots of the docs: report and studio as a person sees them, wide and light, on a phone and dark.

    uv run scanwright build ground_ahead
    uv run python -m benchmarks.scanwright.screens out/ground_ahead

Needs Chromium (Debian: chromium); no page asks the network for anything.
"""

from __future__ import annotations

import io
import shutil
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image
from playwright.sync_api import ViewportSize

from scanwright.design.angles import load_angles
from scanwright.design.task.task import load_task
from scanwright.serving.page_server import guarded_server
from scanwright.studio.page import Studio
from scanwright.studio.state import Setting

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

HERE = Path(__file__).parents[2] / "docs/pictures"
CHROMIUM = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # as root, no graphics card
WIDE, PHONE = ViewportSize(width=1100, height=760), ViewportSize(width=390, height=760)
PATIENCE_S = 300.0
GAP, COLOURS = 24, 256


def main() -> None:
    """Write `report.png` and `studio.png`."""
    from playwright.sync_api import sync_playwright

    build = Path(sys.argv[1] if len(sys.argv) > 1 else "out/ground_ahead")
    program = shutil.which("chromium")
    if program is None:
        sys.exit("chromium is not installed")
    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=program, args=CHROMIUM)
        report(chromium, (build / "report.html").resolve().as_uri())
        studio(chromium, build)
        chromium.close()


def report(chromium: Browser, address: str) -> None:
    """The scanner wide, and what it sees on a phone."""
    wide, phone = windows(chromium)
    for page in (wide, phone):
        page.goto(address)
        page.locator("#drawn").wait_for()
    phone.check("#view-room", force=True)
    phone.locator("#place").scroll_into_view_if_needed()
    beside([on_screen(wide), on_screen(phone)]).quantize(COLOURS).save(HERE / "report.png", optimize=True)


def studio(chromium: Browser, build: Path) -> None:
    """The studio at the angles of the build."""
    angles = load_angles(build / "angles.json").angles_deg
    with guarded_server("Scanwright studio") as (server, gate):
        shown = Studio(server, load_task(build / "task.toml"), Path.cwd(), build.parent)
        shown.searching.begin()  # for the landscapes of the pads
        while shown.controls.optimise.disabled:
            time.sleep(0.5)
        shown.move(Setting((angles.alpha_rot, angles.beta_rot, angles.alpha_laser, angles.beta_laser)))
        shown.judging.settled(PATIENCE_S)
        shown.workers.settled(PATIENCE_S)
        pictures = []
        for page in windows(chromium):
            page.goto(gate.address)
            page.get_by_text("exact").wait_for()
            page.get_by_text("Software WebGL rendering").wait_for()  # of this computer, not of the studio
            page.locator(".mantine-Notification-closeButton").first.click()
            page.get_by_text("Software WebGL rendering").wait_for(state="detached")
            page.wait_for_timeout(3000)
            pictures.append(on_screen(page))
        beside(pictures).quantize(COLOURS).save(HERE / "studio.png", optimize=True)
        shown.close()


def windows(chromium: Browser) -> tuple[Page, Page]:
    """One wide and light, one of a phone and dark, of one height on the picture."""
    wide = chromium.new_page(viewport=WIDE, color_scheme="light")
    phone = chromium.new_page(viewport=PHONE, color_scheme="dark")
    for page in (wide, phone):
        page.set_default_timeout(1000 * PATIENCE_S)
    return wide, phone


def on_screen(page: Page) -> Image.Image:
    """What a window shows, once its pictures are drawn."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def beside(pictures: list[Image.Image]) -> Image.Image:
    """One beside the other."""
    out = Image.new("RGB", (sum(p.width + GAP for p in pictures), max(p.height for p in pictures)), "white")
    x = 0
    for picture in pictures:
        out.paste(picture, (x, 0))
        x += picture.width + GAP
    return out


if __name__ == "__main__":
    main()
