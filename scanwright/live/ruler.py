"""A ruler on a growing cloud: the distance between two clicked points."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import viser
from jaxtyping import Float
from numpy import ndarray

from scanwright.design.arrays import Float32s, Vector

REACH_RAD = np.radians(1.0)  # of a click about its ray
COLOUR = (224, 49, 49)  # red: no colour scale of the points contains it


def nearest_to_ray(
    clouds: Sequence[Float[ndarray, "n 3"]], origin_m: Vector, direction: Vector
) -> Float[ndarray, " 3"] | None:
    """Return the point that a click selects: of those near its ray the nearest to the eye; None if there is none."""
    along = np.asarray(direction, float) / np.linalg.norm(direction)
    best, best_m = None, np.inf
    for points in clouds:
        to = np.asarray(points, float) - origin_m
        ahead_m = to @ along
        off_ray_m = np.sqrt(np.maximum((to**2).sum(axis=1) - ahead_m**2, 0.0))
        hit = (ahead_m > 0) & (off_ray_m < np.tan(REACH_RAD) * ahead_m)
        # of a wall seen at a low angle the middle of the click, not its near edge
        cost_m = np.where(hit, ahead_m + off_ray_m / np.tan(REACH_RAD), np.inf)
        first = int(np.argmin(cost_m)) if len(cost_m) else 0
        if len(cost_m) and cost_m[first] < best_m:
            best, best_m = np.asarray(points[first], float), float(cost_m[first])
    return best


class Ruler:
    """The ruler of a page. `points` returns the points shown; `ends` are the clicked ones."""

    def __init__(self, server: viser.ViserServer, points: Callable[[], Sequence[Float32s]]) -> None:
        self._scene, self._points = server.scene, points
        self.ends: list[Vector] = []
        self.on = server.gui.add_checkbox("measure", initial_value=False, hint="Click two points of the cloud")
        self.on.on_update(lambda _: self._arm())

    @property
    def text(self) -> str:
        """The distance as text; empty before the second click."""
        return f"{np.linalg.norm(self.ends[1] - self.ends[0]):.3f} m" if len(self.ends) == 2 else ""

    def click(self, origin_m: Vector, direction: Vector) -> None:
        """Use the selected point as the next end; a third one begins anew."""
        end = nearest_to_ray(self._points(), np.asarray(origin_m, float), np.asarray(direction, float))
        if end is None:
            return
        self.ends = [*self.ends, end] if len(self.ends) == 1 else [end]
        self._draw()

    def _arm(self) -> None:
        self._scene.remove_click_callback()
        if not self.on.value:
            self.ends = []
            self._draw()
            return

        @self._scene.on_click()
        def _(event: viser.SceneClickEvent) -> None:
            self.click(np.array(event.ray_origin), np.array(event.ray_direction))

    def _draw(self) -> None:
        for name in ("/ruler/ends", "/ruler/line", "/ruler/length"):
            self._scene.remove_by_name(name)
        if self.ends:
            ends = np.array(self.ends, np.float32)
            self._scene.add_point_cloud(
                "/ruler/ends", ends, COLOUR, point_size=0.04, point_shape="circle", precision="float32"
            )
        if len(self.ends) == 2:
            first, last = self.ends
            self._scene.add_line_segments(
                "/ruler/line", ends[None], colors=COLOUR, thickness=3.0, thickness_units="screen"
            )
            self._scene.add_label("/ruler/length", self.text, position=tuple(((first + last) / 2).tolist()))
