"""The brush: what it paints on the sphere, and how the page shows that it is in hand."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any

import numpy as np
import viser

from scanwright.studio.panel.controls import BRUSHES, Controls
from scanwright.studio.state import Dab
from scanwright.studio.view.coloured_sphere import RADIUS_M, direction_hit
from scanwright.studio.view.view_3d import View3D

STROKE = 0.5  # of the radius: a stroke leaves a dab each time it has moved that far
LEAST_DEG, MOST_DEG = 1.0, 60.0  # radius of a dab; as the slider

Paint = Callable[[tuple[Dab, ...], int], None]
"""Takes all dabs as they are now, and the number of the stroke that laid the last one."""


class PaintBrush:
    """The brush of a page: in hand it paints, put away a drag turns the view again."""

    def __init__(self, view: View3D, controls: Controls, dabs: Callable[[], tuple[Dab, ...]], paint: Paint) -> None:
        """`dabs` tells those that are there, `paint` takes them with one more."""
        self._view, self._controls, self._dabs, self._paint = view, controls, dabs, paint
        self._strokes = 0

    @property
    def radius_deg(self) -> float:
        """Radius of the cone that a dab paints."""
        return float(np.clip(self._controls.radius.value, LEAST_DEG, MOST_DEG))

    def arm(self, guarded: Callable[[Callable[[], Any]], Callable[[Any], None]]) -> None:
        """Take it in hand, or put it away; `told` wraps what may be refused."""
        sphere = self._view.sphere
        sphere.remove_click_callback()
        sphere.remove_drag_callback()
        self.show()
        if not self._controls.painting.value:
            return

        @sphere.on_click
        async def _(event: Any) -> None:
            self._strokes += 1
            guarded(lambda: self.dab(event.ray_origin, event.ray_direction))(event)

        @sphere.on_drag
        async def _(event: viser.SceneNodeDragEvent[Any]) -> None:
            self._strokes += event.phase == "start"
            eye = np.asarray(event.client.camera.position)
            guarded(lambda: self.dab(eye, np.asarray(event.end_position) - eye))(event)

    def dab(self, ray_origin: Any, ray_direction: Any) -> None:
        """Touch the sphere where a ray from the camera meets it.

        Raises:
            TaskError: there is too much paint.
        """
        c = self._controls
        hit = direction_hit(ray_origin, ray_direction)
        if hit is None or not c.painting.value or c.brush.value not in BRUSHES:
            return
        x, y, z = (float(value) for value in hit)
        dabs, weight = self._dabs(), float(np.clip(c.weight.value, 0.01, 1000.0))
        new = Dab((x, y, z), self.radius_deg, c.brush.value, weight)
        near = dabs and np.dot(dabs[-1].direction, hit) > np.cos(np.radians(STROKE * new.radius_deg))
        if not (near and dabs[-1].paints == new.paints):
            self._paint((*dabs, new), self._strokes)

    def show(self) -> None:
        """Tell the page what its ring and its line of mode are to show: `brush_ring.js` reads this."""
        c = self._controls
        words = f"Painting: {c.brush.value}, {self.radius_deg:g} deg. B puts the brush away"
        c.mode.content = (
            f'<div class="sw-brush" hidden data-brush="{escape(str(c.brush.value))}" data-sphere-m="{RADIUS_M}" '
            f'data-radius-deg="{self.radius_deg:g}">{escape(words)}</div>'
            if c.painting.value
            else ""
        )
