"""The screenshots of README: the report of a build as a person sees it, wide and on a phone.

    uv run scanwright build ground_ahead
    uv run python -m benchmarks.scanwright.screens out/ground_ahead

Needs Chromium (Debian: chromium); no page asks the network for anything.
"""

from __future__ import annotations

import io
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from PIL import Image

if TYPE_CHECKING:
    from playwright.sync_api import Page

HERE = Path(__file__).parents[2] / "docs/pictures"
CHROMIUM = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # as root, no graphics card
WIDE, PHONE = (1400, 900), (390, 844)
GAP, COLOURS = 24, 256


def main() -> None:
    """Write `report.png`."""
    from playwright.sync_api import sync_playwright

    build = Path(sys.argv[1] if len(sys.argv) > 1 else "out/ground_ahead")
    program = shutil.which("chromium")
    if program is None:
        sys.exit("chromium is not installed")
    with sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=program, args=CHROMIUM)
        address = (build / "report.html").resolve().as_uri()
        wide, phone = (
            chromium.new_page(viewport={"width": width, "height": height}, device_scale_factor=scale)
            for (width, height), scale in ((WIDE, 1), (PHONE, 1.2))
        )
        for page in (wide, phone):
            page.goto(address)
        pictures = [on_screen(wide), on_screen(phone)]
        beside(pictures).quantize(COLOURS).save(HERE / "report.png", optimize=True)
        chromium.close()


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
