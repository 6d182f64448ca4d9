"""The screenshot of the studio in README, wide and on a phone, at the angles of a build.

    uv run scanwright build ground_ahead
    uv run python -m benchmarks.scanwright.studio_picture out/ground_ahead

Needs Chromium (Debian: chromium); no page asks the network for anything.
"""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from benchmarks.scanwright.screens import CHROMIUM, COLOURS, HERE, PHONE, beside, on_screen
from scanwright.design.angles import load_angles
from scanwright.design.task.task import load_task
from scanwright.serving.page_server import guarded_server
from scanwright.studio.page import Studio
from scanwright.studio.state import Setting

WIDE = (1200, 720)
PATIENCE_S = 300.0


def main() -> None:
    """Write `studio.png`."""
    from playwright.sync_api import sync_playwright

    build = Path(sys.argv[1] if len(sys.argv) > 1 else "out/ground_ahead")
    program = shutil.which("chromium")
    if program is None:
        sys.exit("chromium is not installed")
    angles = load_angles(build / "angles.json").angles_deg
    with guarded_server("Scanwright studio") as (server, gate), sync_playwright() as driver:
        studio = Studio(server, load_task(build / "task.toml"), Path.cwd(), build.parent)
        studio.move(Setting((angles.alpha_rot, angles.beta_rot, angles.alpha_laser, angles.beta_laser)))
        studio.judging.settled(PATIENCE_S)
        studio.workers.settled(PATIENCE_S)
        chromium = driver.chromium.launch(executable_path=program, args=CHROMIUM)
        pictures = []
        for width, height in (WIDE, PHONE):
            page = chromium.new_page(viewport={"width": width, "height": height})
            page.set_default_timeout(1000 * PATIENCE_S)
            page.goto(gate.address)
            page.get_by_text("exact").wait_for()
            page.get_by_text("Software WebGL rendering").wait_for()  # of this computer, not of the studio
            page.locator(".mantine-Notification-closeButton").first.click()
            page.get_by_text("Software WebGL rendering").wait_for(state="detached")
            page.wait_for_timeout(3000)
            pictures.append(on_screen(page))
            page.close()
        beside(pictures).quantize(COLOURS).save(HERE / "studio.png", optimize=True)
        chromium.close()
        studio.close()


if __name__ == "__main__":
    main()
