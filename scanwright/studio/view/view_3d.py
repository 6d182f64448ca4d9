"""The 3D view of the page."""

from __future__ import annotations

import numpy as np
import viser
import viser.transforms

from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import Problem
from scanwright.design.task.task import Task
from scanwright.report.colours import Bands, ramp
from scanwright.report.room import room_about
from scanwright.serving.density_room import DensityRoom, lit
from scanwright.studio.state import Setting
from scanwright.studio.view.outlines import edges
from scanwright.studio.view.scanner_bodies import BodyMesh

RADIUS_M = 0.5  # of the drawn field of view
MARK = 1.12  # of the distance to a wall: words are drawn there
LIFT = 0.012  # of the distance to a wall: edges are drawn this far before it
WEIGHT_EDGE, MASK_EDGE, FAN = (255, 255, 255), (224, 49, 49), (43, 138, 62)
POINT_M = 0.012  # as in the page of a scan, `live.cloud_view`
GHOST = 0.25  # opacity of parts that belong to an earlier setting


class View3D:
    """The scene of one page: the room with its densities, the scanner in it, its field of view, a scan."""

    def __init__(self, server: viser.ViserServer, task: Task) -> None:
        self._scene = server.scene
        self._bodies: dict[bool, list[viser.MeshHandle]] = {True: [], False: []}
        self._cloud: viser.PointCloudHandle | None = None
        self._edges: tuple[Array, ...] = ()
        self._colours = True
        self.points = 0
        lit(self._scene)
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        self.scanner = self._scene.add_frame("/scanner", show_axes=False)
        self.room = room_about(task)
        self.walls = DensityRoom(self._scene, self.room)
        x, y, z = self.room.high - self.room.low
        server.initial_camera.position = (float(-0.8 * x), float(0.8 * y), float(0.5 * (x + z)))
        for name, direction in (("ahead", (1.0, 0.0, 0.0)), ("left", (0.0, 1.0, 0.0))):
            at = MARK * self.room.walls_along(np.array(direction))
            self._scene.add_label(f"/{name}", name, position=tuple(at.tolist()))

    def show_density(self, visible: bool) -> None:
        """Show or hide the walls and the edges on them."""
        self._colours = self.walls.frame.visible = visible
        self._draw_edges()

    def colour(self, problem: Problem, setting: Setting, bands: Bands) -> None:
        """Colour the walls by the density of a setting, and show its axis and field of view."""
        if self._colours:
            density = mean_density_at(problem, setting.angles_rad, self.walls.directions)
            self.walls.colour(density, bands)
        R = R_world_rot(*setting.angles_rad[:2])
        beams = problem.beams_rot(setting.angles_rad[2:]) @ R.T
        rim = 0.98 * RADIUS_M * beams[:: max(1, len(beams) // 90)]
        axis = 1.2 * RADIUS_M * np.stack([-R[:, 2], R[:, 2]])
        ends = np.stack([np.zeros((2, 3)), rim[[0, -1]]], axis=1)
        self._draw_lines("/fan", np.concatenate([axis[None], np.stack([rim[:-1], rim[1:]], axis=1), ends]), FAN)

    def outline(self, problem: Problem) -> None:
        """Draw the edges of what matters and of what is hidden."""
        self._edges = edges(problem.field)
        self._draw_edges()

    def _draw_edges(self) -> None:
        for node, segments, colour in zip(("/weight", "/mask"), self._edges, (WEIGHT_EDGE, MASK_EDGE), strict=False):
            if len(segments) and self._colours:
                self._draw_lines(node, (1 - LIFT) * self.room.walls_along(segments), colour)
            else:
                self._scene.remove_by_name(node)

    def _draw_lines(self, node: str, segments: Array, colour: tuple[int, int, int]) -> None:
        self._scene.add_line_segments(
            node, segments.astype(np.float32), colors=colour, thickness=3.0, thickness_units="screen"
        )

    def show_bodies(self, setting: Setting, turning: bool, bodies: tuple[BodyMesh, ...]) -> None:
        """Show the half of the scanner that turns, or the one that is fixed, in place of the previous one."""
        half = "turning" if turning else "standing"
        self.scanner.wxyz = viser.transforms.SO3.from_matrix(R_world_rot(*setting.angles_rad[:2])).wxyz
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

    def fade_bodies(self, turning: bool) -> None:
        """Show one half of the scanner as of an earlier setting, until `show_bodies` replaces it."""
        for handle in self._bodies[turning]:
            handle.opacity = GHOST

    def show_points(self, points_m: Array) -> None:
        """Show a scan, coloured by height."""
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
