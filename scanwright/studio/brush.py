"""The brush: what it paints on the walls, and how the page shows that it is active."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import numpy as np
import viser

from scanwright.studio.panel.controls import BRUSHES, Controls
from scanwright.studio.state import Dab
from scanwright.studio.view.view_3d import View3D

STROKE = 0.5  # of the radius: a stroke leaves a dab each time it has moved that far
LEAST_DEG, MOST_DEG = 1.0, 60.0  # radius of a dab; as the slider

Paint = Callable[[tuple[Dab, ...], int], None]  # called with all dabs and the number of the last stroke


class PaintBrush:
    """The brush of a page: while it is active, a drag on the walls paints; otherwise it turns the view."""

    def __init__(self, view: View3D, controls: Controls, dabs: Callable[[], tuple[Dab, ...]], paint: Paint) -> None:
        self._view, self._controls, self._dabs, self._paint = view, controls, dabs, paint
        self._strokes = 0

    @property
    def radius_deg(self) -> float:
        """Radius of the cone that a dab paints."""
        return float(np.clip(self._controls.radius.value, LEAST_DEG, MOST_DEG))

    def arm(self, guarded: Callable[[Callable[[], Any]], Callable[[Any], None]]) -> None:
        """Follow the checkbox of the brush; `guarded` shows errors of a handler."""
        self.show()
        for wall in (each.handle for each in self._view.walls.walls):
            wall.remove_click_callback()
            wall.remove_drag_callback()
            if self._controls.painting.value:
                self._arm(wall, guarded)

    def _arm(self, wall: viser.ImageHandle, guarded: Callable[[Callable[[], Any]], Callable[[Any], None]]) -> None:
        @wall.on_click
        async def _(event: Any) -> None:
            self._strokes += 1
            guarded(lambda: self.dab(event.ray_origin, event.ray_direction))(event)

        @wall.on_drag
        async def _(event: viser.SceneNodeDragEvent[Any]) -> None:
            self._strokes += event.phase == "start"
            eye = np.asarray(event.client.camera.position)
            guarded(lambda: self.dab(eye, np.asarray(event.end_position) - eye))(event)

    def dab(self, ray_origin: Any, ray_direction: Any) -> None:
        """Paint where a ray from the camera leaves the room; raise TaskError if there is too much paint."""
        c = self._controls
        hit = self._view.room.beyond(np.asarray(ray_origin, float), np.asarray(ray_direction, float))
        if hit is None or not c.painting.value or c.brush.value not in BRUSHES:
            return
        x, y, z = (float(value) for value in hit)
        dabs, weight = self._dabs(), float(np.clip(c.weight.value, 0.01, 1000.0))
        new = Dab((x, y, z), self.radius_deg, c.brush.value, weight)
        near = dabs and np.dot(dabs[-1].direction, hit) > np.cos(np.radians(STROKE * new.radius_deg))
        if not (near and dabs[-1].paints == new.paints):
            self._paint((*dabs, new), self._strokes)

    def show(self) -> None:
        """Show the mode; the cursor of the view follows it."""
        c = self._controls
        words = f"Painting: {c.brush.value}, {self.radius_deg:g} deg. B turns the brush off."
        c.mode.content = f'<div class="sw-brush" role="status">{escape(words)}</div>' if c.painting.value else ""
