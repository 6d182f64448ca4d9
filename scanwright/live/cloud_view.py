"""The growing cloud of a scan, coloured by height, range, intensity or time."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal, get_args

import numpy as np
import viser
from jaxtyping import Int64
from numpy import ndarray

from scanwright.design.arrays import Float32s, Vector
from scanwright.firmware_io.clouds.cloud import Cloud
from scanwright.firmware_io.clouds.formats import write_clouds
from scanwright.firmware_io.scan.live_feed import CloudGrowth
from scanwright.firmware_io.scan.scan_end import LOST, ScanEnd
from scanwright.live.ruler import Ruler
from scanwright.live.saved_page import saved_page
from scanwright.report.colours import COLOUR_STOPS, Bands, Colours, ramp
from scanwright.serving.density_room import DensityRoom, lit
from scanwright.serving.style import banner_html, key_html, note_html

ColourBy = Literal["height", "range", "intensity", "time"]
COLOUR_BY: tuple[ColourBy, ...] = get_args(ColourBy)
UNITS: dict[ColourBy, str] = {"height": " m", "range": " m", "intensity": "", "time": " s"}
NO_CUT_M = 10.0  # of the slider: nothing is cut away
CHUNK_POINTS = 20_000  # of one node of the scene: a batch joins the last one until that is full
MOST_POINTS = 5_000_000  # the page drops the oldest beyond
POINT_M = 0.012  # 12 mm; the slider offers 2 to 50


@dataclass(slots=True)
class _Chunk:
    """Points of one node."""

    name: str
    values: dict[ColourBy, Float32s]
    points_m: Float32s
    handle: viser.PointCloudHandle = field(init=False)


class CloudView:
    """The page of one scan."""

    def __init__(
        self, server: viser.ViserServer, name: str, centre_m: Vector, full_scan_s: float | None = None
    ) -> None:
        """`name` is that of saved files, `centre_m` the optical centre; `full_scan_s` is None if it is unknown."""
        self._full_scan_s, self._latest_s = full_scan_s, 0.0
        self.server, self._name, self.centre_m = server, name, centre_m
        self._lowest_m = np.inf
        self.chunks: deque[_Chunk] = deque()
        self._number = 0
        self._spans: dict[ColourBy, tuple[float, float]] = {}
        self.points, self.forgotten = 0, 0
        server.initial_camera.position = (-4.0, -3.0, 3.0)
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        lit(server.scene)
        server.scene.add_frame("/scanner", axes_length=0.3, axes_radius=0.01)
        self.end: ScanEnd | None = None
        self.banner = server.gui.add_html(banner_html("running", (), lost=LOST.lines))
        self.facts = server.gui.add_html("")
        self.bar = server.gui.add_progress_bar(0.0, visible=False)
        self._line = server.gui.add_html(note_html("waiting for the first scan"))
        self.by = server.gui.add_dropdown("colour by", COLOUR_BY, initial_value="height")
        self.legend = server.gui.add_html("")
        self._key = server.gui.add_html("")
        self._size = server.gui.add_slider("point size [mm]", 2.0, 50.0, 1.0, 1000 * POINT_M)
        self.cut = server.gui.add_slider(
            "cut above [m]", 0.0, NO_CUT_M, 0.1, NO_CUT_M, hint="Above the lowest point: removes the ceiling"
        )
        self._walls: DensityRoom | None = None
        self._expected = server.gui.add_checkbox("expected density", initial_value=True, visible=False)
        self.by.on_update(lambda _: self._recolour())
        self._size.on_update(lambda _: self._resize())
        self.cut.on_update(lambda _: self._draw_all())
        self._expected.on_update(lambda _: self._show_expected())
        self.ruler = Ruler(server, lambda: [chunk.points_m for chunk in list(self.chunks)])
        for name, suffix in (("Save as PLY", ".ply"), ("Save as web page", ".html")):
            save = server.gui.add_button(name, hint="Into the downloads of your browser")
            save.on_click(partial(self._save, suffix=suffix))

    def expect(self, walls: DensityRoom, bands: Bands) -> None:
        """Offer to show walls in the colours of the beams that a full scan sends there."""
        self._walls = walls
        self._key.content = key_html(bands, "expected beams per direction in one full scan")
        self._expected.visible = True

    def _show_expected(self) -> None:
        if self._walls is not None:
            self._walls.frame.visible = self._expected.value

    def add(self, growth: CloudGrowth) -> None:
        """Show new points and messages of the scan."""
        if len(growth.points_m):
            values: dict[ColourBy, Float32s] = {
                "height": growth.points_m[:, 2],
                "range": np.linalg.norm(growth.points_m - self.centre_m, axis=1).astype(np.float32),
                "intensity": growth.intensity,
                "time": growth.time_s,
            }
            self._lowest_m = min(self._lowest_m, float(growth.points_m[:, 2].min()))
            self._spread(values)
            self._append(growth.points_m, values)
            self.points += len(growth.points_m)
            self._latest_s = max(self._latest_s, float(growth.time_s.max()))
            while sum(len(chunk.points_m) for chunk in self.chunks) > MOST_POINTS:
                oldest = self.chunks.popleft()
                self.forgotten += len(oldest.points_m)
                oldest.handle.remove()
        left = f"; the view dropped the oldest {self.forgotten:,}" if self.forgotten else ""
        left += f"; the view dropped {growth.lost:,} scans, the recording none" if growth.lost else ""
        self.facts.content = note_html(f"{self.points:,} points{self._progress()}{left}")
        for line in growth.lines:
            self.show_message(line)
        if growth.end is not None and growth.end != self.end:
            self.show_end(growth.end)

    def show_end(self, end: ScanEnd) -> None:
        """Show how the scan ended in a banner that stays, also for pages that are opened later."""
        self.end = end
        self.banner.content = banner_html(end.outcome, (end.heading, *end.lines))

    def show_message(self, line: str) -> None:
        """Show a message of the scan: speed, rates, dropped packets."""
        self._line.content = note_html(line)

    def cloud(self) -> Cloud:
        """Return the cloud that is shown."""
        chunks = list(self.chunks)
        points = np.concatenate([np.empty((0, 3), np.float32), *(chunk.points_m for chunk in chunks)])
        saved: tuple[tuple[ColourBy, str, str], ...] = (("intensity", "intensity", "<f4"), ("time", "time_s", "<f8"))
        columns = {
            name: np.concatenate([np.empty(0, np.float32), *(chunk.values[by] for chunk in chunks)]).astype(kind)
            for by, name, kind in saved
        }
        return Cloud(points, columns)

    def _save(self, event: viser.GuiEvent, suffix: str) -> None:
        if event.client is None or not self.chunks:
            return
        with TemporaryDirectory() as folder:
            path = Path(folder) / f"{self._name}{suffix}"
            if suffix == ".ply":
                write_clouds(path, [self.cloud()])
            else:
                path.write_text(self.page(), encoding="utf-8")
            event.client.send_file_download(path.name, path.read_bytes(), save_immediately=True)

    def page(self) -> str:
        """Return the cloud as one web page, in the colours that are shown."""
        by, chunks = self._by, list(self.chunks)
        points = np.concatenate([chunk.points_m for chunk in chunks])
        values = np.concatenate([chunk.values[by] for chunk in chunks])
        low, high = self._spans[by]
        kept = points[:, 2] <= self._highest_m
        ends = f"{by}: {low:.1f}{UNITS[by]}", f"{high:.1f}{UNITS[by]}"
        level = (values[kept] - low) / max(high - low, 1e-6)
        return saved_page(f"Scan of {self._name}", points[kept], level, ends, self.centre_m)

    @property
    def _by(self) -> ColourBy:
        return self.by.value if self.by.value in COLOUR_BY else "height"

    @property
    def _highest_m(self) -> float:
        """Return the height above which nothing is shown."""
        return np.inf if self.cut.value >= NO_CUT_M else self._lowest_m + float(self.cut.value)

    def _progress(self) -> str:
        """Return how much of the present full scan is done, and show it on the bar."""
        if not self._full_scan_s or not self.points:
            return ""
        scans, in_scan_s = divmod(self._latest_s, self._full_scan_s)
        share = in_scan_s / self._full_scan_s
        self.bar.value, self.bar.visible = 100 * share, True  # type: ignore[misc]
        return f"; full scan {scans + 1:.0f}: {share:.0%} ({in_scan_s:.1f} of {self._full_scan_s:g} s)"

    def _append(self, points_m: Float32s, values: dict[ColourBy, Float32s]) -> None:
        if self.chunks and len(self.chunks[-1].points_m) < CHUNK_POINTS:
            chunk = self.chunks[-1]
            chunk.points_m = np.concatenate([chunk.points_m, points_m])
            chunk.values = {by: np.concatenate([chunk.values[by], values[by]]) for by in COLOUR_BY}
        else:
            self._number += 1
            chunk = _Chunk(f"/cloud/{self._number}", values, points_m)
            self.chunks.append(chunk)
        self._draw(chunk)

    def _draw(self, chunk: _Chunk) -> None:
        order = self._shown(chunk)
        chunk.handle = self.server.scene.add_point_cloud(
            chunk.name,
            chunk.points_m[order],
            self._colours(chunk, order),
            point_size=self._size.value / 1000,
            point_shape="circle",
            point_shading="flat",
            precision="float32",
        )

    def _draw_all(self) -> None:
        for chunk in list(self.chunks):
            self._draw(chunk)

    def _shown(self, chunk: _Chunk) -> Int64[ndarray, " n"]:
        """Return the points below the cut, in a random order: the first of them are a thinned cloud."""
        order = np.random.default_rng(0).permutation(len(chunk.points_m))
        return order[chunk.points_m[order, 2] <= self._highest_m]

    def _spread(self, values: dict[ColourBy, Float32s]) -> None:
        """Widen the colour scales; recolour all points if the present one grew by much."""
        grown = not self.legend.content
        for by, new in values.items():
            low, high = (float(x) for x in np.percentile(new, [1, 99]))
            before = self._spans.get(by, (low, high))
            after = min(low, before[0]), max(high, before[1])
            self._spans[by] = after
            grown |= by == self.by.value and after[1] - after[0] > 1.2 * (before[1] - before[0])
        if grown:
            self._recolour()

    def _colours(self, chunk: _Chunk, order: Int64[ndarray, " n"]) -> Colours:
        low, high = self._spans[self._by]
        return ramp((chunk.values[self._by][order] - low) / max(high - low, 1e-6))

    def _recolour(self) -> None:
        by = self._by
        if by in self._spans:
            self.legend.content = scale_html(by, *self._spans[by], UNITS[by])
        for chunk in list(self.chunks):
            chunk.handle.colors = self._colours(chunk, self._shown(chunk))

    def _resize(self) -> None:
        for chunk in list(self.chunks):
            chunk.handle.point_size = float(np.clip(self._size.value, 1.0, 200.0)) / 1000


def scale_html(name: str, low: float, high: float, unit: str) -> str:
    """Return the colour scale from a lowest to a highest value."""
    stops = ", ".join(f"rgb{stop}" for stop in COLOUR_STOPS)
    bar = f'<div style="height:10px;margin:2px 0;background:linear-gradient(to right, {stops})"></div>'
    cells = "".join(f"<span>{word}</span>" for word in (f"{low:.1f}{unit}", name, f"{high:.1f}{unit}"))
    return (
        f'<div style="font-size:12px;margin:2px 12px">{bar}'
        f'<div style="display:flex;justify-content:space-between">{cells}</div></div>'
    )
