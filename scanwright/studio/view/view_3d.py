"""What stands in the middle of the page: the sphere, the scanner in it, its fan, and a scan of a scene."""

from __future__ import annotations

from typing import Literal

import numpy as np
import viser
import viser.transforms

from design.arrays import Array
from design.frames import R_world_rot
from design.objective.problem import Problem
from scanwright.serving.style import Colours, ramp
from scanwright.studio.state import Setting
from scanwright.studio.view.coloured_sphere import RADIUS_M, density_colours, edges, hexagons
from scanwright.studio.view.scanner_bodies import BodyMesh

Look = Literal["from inside", "from outside", "hidden"]
SIDES: dict[Look, Literal["front", "back"]] = {"from inside": "back", "from outside": "front", "hidden": "back"}
LIFT = 0.012  # of the radius: edges are drawn this far from the tiles, on the side that is looked at
WEIGHT_EDGE, MASK_EDGE, FAN = (255, 255, 255), (224, 49, 49), (43, 138, 62)
POINT_M = 0.012


class View3D:
    """The scene of one page."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._scene = server.scene
        self._looked: Look = "from inside"
        self._bodies: dict[bool, list[viser.MeshHandle]] = {True: [], False: []}
        self._edges: list[viser.LineSegmentsHandle] = []
        self._cloud: viser.PointCloudHandle | None = None
        self.points = 0
        self._scene.configure_default_lights(enabled=False, cast_shadow=False)
        self._scene.add_light_ambient("/light/all", intensity=2.2)
        self._scene.add_light_directional("/light/above", intensity=1.2, position=(1.0, 0.6, 2.0), cast_shadow=False)
        server.initial_camera.position = (-0.75, 0.95, 0.65)
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        self._scanner = self._scene.add_frame("/scanner", show_axes=False)
        self._scene.add_label("/ahead", "ahead", position=(1.12 * RADIUS_M, 0.0, 0.0))
        self._scene.add_label("/left", "left", position=(0.0, 1.12 * RADIUS_M, 0.0))
        self.tiles = hexagons()
        self.sphere = self._scene.add_batched_meshes_simple(
            "/sphere",
            self.tiles.corners_m,
            self.tiles.faces,
            self.tiles.wxyz,
            self.tiles.directions * RADIUS_M,
            batched_colors=(200, 200, 200),
            side=SIDES[self._looked],
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
        )

    @property
    def inside(self) -> bool:
        """Whether the far wall is seen, from within."""
        return self._looked != "from outside"

    def look(self, looked: Look) -> None:
        """Show the far half of the sphere with the scanner before it, the near half, or none."""
        self._looked = looked
        self.sphere.side = SIDES[looked]
        self.sphere.visible = looked != "hidden"
        for handle in self._edges:
            handle.visible = looked != "hidden"
            handle.scale = self._lift()

    def colour(self, problem: Problem, setting: Setting, highest: float) -> None:
        """Colour the tiles by the density of a setting, and show its axis and fan."""
        colours = density_colours(problem, setting.angles_rad, self.tiles.directions, highest)
        self.sphere.batched_colors = _linear(colours)
        R = R_world_rot(*setting.angles_rad[:2])
        beams = problem.beams_rot(setting.angles_rad[2:]) @ R.T
        rim = 0.98 * RADIUS_M * beams[:: max(1, len(beams) // 90)]
        axis = 0.6 * np.stack([-R[:, 2], R[:, 2]]) * RADIUS_M * 2
        ends = np.stack([np.zeros((2, 3)), rim[[0, -1]]], axis=1)
        lines = np.concatenate([axis[None], np.stack([rim[:-1], rim[1:]], axis=1), ends])
        self._scene.add_line_segments(
            "/fan", lines.astype(np.float32), colors=FAN, thickness=2.5, thickness_units="screen"
        )

    def outline(self, problem: Problem) -> None:
        """Draw the edges of what matters and of what is hidden."""
        self._edges = []
        for name, segments, colour in zip(
            ("weight", "mask"), edges(problem.field), (WEIGHT_EDGE, MASK_EDGE), strict=True
        ):
            node = f"/edge/{name}"
            if len(segments):
                handle = self._scene.add_line_segments(
                    node,
                    (RADIUS_M * segments).astype(np.float32),
                    colors=colour,
                    thickness=3.0,
                    thickness_units="screen",
                    scale=self._lift(),
                )
                handle.visible = self._looked != "hidden"
                self._edges.append(handle)
            else:
                self._scene.remove_by_name(node)

    def show_bodies(self, setting: Setting, turning: bool, bodies: tuple[BodyMesh, ...]) -> None:
        """Put up the half of the scanner that turns, or the one that stands, in place of what stood there."""
        half = "turning" if turning else "standing"
        self._scanner.wxyz = viser.transforms.SO3.from_matrix(R_world_rot(*setting.angles_rad[:2])).wxyz
        new = {f"/scanner/{half}/{body.name}": body for body in bodies}
        for handle in self._bodies[turning]:
            if handle.name not in new:
                handle.remove()
        self._bodies[turning] = [
            self._scene.add_mesh_simple(
                name, body.vertices_m, body.faces, color=body.colour, flat_shading=True, cast_shadow=False
            )
            for name, body in new.items()
        ]

    def show_scanner(self, visible: bool) -> None:
        """Show or hide it."""
        self._scanner.visible = visible

    def show_points(self, points_m: Array) -> None:
        """Show a scan, coloured by height; none where there is no point."""
        self.points = len(points_m)
        if self._cloud is not None:
            self._cloud.remove()
            self._cloud = None
        if len(points_m):
            low, high = np.percentile(points_m[:, 2], [1, 99])
            colours = ramp((points_m[:, 2] - low) / max(high - low, 1e-6))
            self._cloud = self._scene.add_point_cloud(
                "/scan",
                points_m,
                colours,
                point_size=POINT_M,
                point_shape="circle",
                point_shading="flat",
                precision="float32",
            )

    def _lift(self) -> float:
        return 1 - LIFT if self.inside else 1 + LIFT


def _linear(colours: Colours) -> Colours:
    """What the page's renderer takes colours of tiles for: linear light, not sRGB."""
    c = colours / 255.0
    return np.round(255 * np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)).astype(np.uint8)
