"""What axe-core finds on every page in every state: at 1440, 720 and 390 px, light and dark.

    uv run scanwright build ground_ahead
    uv run python -m benchmarks.scanwright.barriers out/ground_ahead [FOLDER...] [--pictures DIR]

Reports of the folders (also of a build whose checks failed; a folder can be the documentation with `gallery.html`), the
tabs of the studio, and the live page while it waits, scans, and after each kind of end. Needs Chromium.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, get_args

import numpy as np
from axe_playwright_python.sync_playwright import Axe

from benchmarks.scanwright.budgets import browser
from scanwright.design.progress import no_progress
from scanwright.design.search.optimum import find_optimum
from scanwright.design.task.task import load_task
from scanwright.firmware_io.scan.live_feed import CloudGrowth
from scanwright.firmware_io.scan.scan_end import Outcome, ScanEnd
from scanwright.live.cloud_view import CloudView
from scanwright.serving.page_server import guarded_server
from scanwright.serving.style import banner_html
from scanwright.studio.page import Studio
from scanwright.studio.state import Setting

if TYPE_CHECKING:
    from playwright.sync_api import Page

SIZES, SCHEMES = ((1440, 900), (720, 900), (390, 844)), ("light", "dark")
TABS = ("Angles", "Paint", "Compare", "View", "Save")
ENDS = tuple(ScanEnd(outcome, ("what the terminal prints",)) for outcome in get_args(Outcome))


def main() -> None:
    """Parse the command line, and look at every page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--pictures", type=Path, help="folder of screenshots")
    given = parser.parse_args()
    seen, found = 0, 0
    with browser() as chromium, live_pages(given.folders[0]) as pages:
        for width, height in SIZES:
            for scheme in SCHEMES:
                context = chromium.new_context(viewport={"width": width, "height": height}, color_scheme=scheme)
                page = context.new_page()
                page.set_default_timeout(300_000)
                for state in states(page, given.folders, *pages):
                    barriers = Axe().run(page).response["violations"]
                    for rule in barriers:
                        print(f"{state}, {width} px, {scheme}: {rule['id']}: {rule['nodes'][0]['html'][:160]}")
                    seen, found = seen + 1, found + len(barriers)
                    if given.pictures:
                        page.screenshot(path=given.pictures / f"{state.replace(' ', '_')}_{width}_{scheme}.png")
                context.close()
    print(f"{seen} pages and states: {found} violations")
    raise SystemExit(found > 0)


@contextmanager
def live_pages(folder: Path) -> Iterator[tuple[Studio, str, CloudView, str]]:
    """Serve a studio and a live page, each with its address."""
    task = load_task(folder / "task.toml")
    with (
        guarded_server("Scanwright: studio") as (one, studio_gate),
        guarded_server("Scanwright: scan") as (other, gate),
    ):
        studio = Studio(one, task, Path.cwd(), folder.parent)
        optimum = find_optimum(task, no_progress)
        studio._use_optimum(optimum)
        studio.move(Setting.within_bounds(optimum.search.best[0].angles_deg))
        yield studio, studio_gate.address, CloudView(other, folder.name, np.zeros(3), 18.0), gate.address
        studio.close()


def states(
    page: Page, folders: list[Path], studio: Studio, studio_address: str, view: CloudView, live_address: str
) -> Iterator[str]:
    """Yield the name of each page and state when the page shows it."""
    for folder in folders:
        file = next(file for name in ("report.html", "gallery.html") if (file := folder / name).exists())
        page.goto(file.resolve().as_uri())
        page.evaluate("document.querySelectorAll('details').forEach((details) => (details.open = true))")
        page.wait_for_timeout(500)
        yield f"{file.stem} {folder.name}"
    page.goto(studio_address)
    page.get_by_text("exact").wait_for()
    studio.show("an error", bad=True)
    for tab in TABS:
        page.get_by_role("tab", name=tab).click()
        page.get_by_role("tab", name=tab, selected=True).wait_for()
        yield f"studio {tab}"
    view.banner.content = banner_html("running", ())
    page.goto(live_address)
    page.get_by_text("colour by").wait_for()
    yield "live waiting" if not view.points else "live"
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(-3, 3, (5_000, 2)), np.full(5_000, -1.0)]).astype(np.float32)
    view.add(CloudGrowth(floor, np.zeros(5_000, np.float32), np.linspace(0, 9, 5_000, dtype=np.float32), (), 0))
    page.get_by_text("full scan 1").wait_for()
    yield "live scanning"
    for end in ENDS:
        view.show_end(end)
        page.locator(".sw-banner").filter(has_text=end.heading).wait_for()
        yield f"live {end.outcome}"


if __name__ == "__main__":
    main()
