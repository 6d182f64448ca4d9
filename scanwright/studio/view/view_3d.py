"""What stands in the middle of the page: the sphere or the room, the scanner in it, its fan, and a scan of a scene."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
import viser
import viser.transforms

from scanwright.design.arrays import Array
from scanwright.design.evaluation.coverage import mean_density_at
from scanwright.design.frames import R_world_rot
from scanwright.design.objective.problem import Problem
from scanwright.design.task.task import Task
from scanwright.report.colours import Bands, Colours, ramp
from scanwright.report.room import Room, room_about
from scanwright.serving.density_room import density_colours, lit, room_tiles, unlit
from scanwright.studio.state import Setting
from scanwright.studio.view.coloured_sphere import RADIUS_M, edges, hexagons
from scanwright.studio.view.scanner_bodies import BodyMesh

Look = Literal["in its room", "sphere", "hidden"]
LOOKS: tuple[Look, ...] = get_args(Look)
SPHERE_EYE_M = (-0.75, 0.95, 0.65)  # behind, left and above: ahead points away from the viewer
MARK = 1.12  # of the radius: words are drawn there
LIFT = 0.012  # of the radius: edges are drawn this far before the tiles
WEIGHT_EDGE, MASK_EDGE, FAN = (255, 255, 255), (224, 49, 49), (43, 138, 62)
POINT_M = 0.012  # as in the page of a scan, `live.cloud_view`
GHOST = 0.25  # opacity of parts that belong to an earlier setting


class View3D:
    """The scene of one page."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server, self._scene = server, server.scene
        self._looked: Look = "in its room"
        self._room: viser.BatchedMeshHandle | None = None
        self._placeholder: Room | None = None
        self._room_eye_m = SPHERE_EYE_M
        self._bodies: dict[bool, list[viser.MeshHandle]] = {True: [], False: []}
        self._edges: tuple[Array, ...] = ()
        self._cloud: viser.PointCloudHandle | None = None
        self.points = 0
        lit(self._scene)
        server.initial_camera.look_at = (0.0, 0.0, 0.0)
        self._scanner = self._scene.add_frame("/scanner", show_axes=False)
        self._marks = {
            (1.0, 0.0, 0.0): self._scene.add_label("/ahead", "ahead"),
            (0.0, 1.0, 0.0): self._scene.add_label("/left", "left"),
        }
        self.tiles = hexagons()
        self.sphere = self._scene.add_batched_meshes_simple(
            "/sphere",
            self.tiles.corners_m,
            self.tiles.faces,
            self.tiles.wxyz,
            self.tiles.directions * RADIUS_M,
            batched_colors=_blank(self.tiles.directions),
            side="back",  # of the tiles, which look outwards: the nearer ones are not seen
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=self.on_sphere,
        )

    def look(self, looked: Look) -> None:
        """Show the far half of the sphere with the scanner before it, the room instead, or nothing."""
        in_room = (self._looked == "in its room") != (looked == "in its room")
        self._looked = looked
        self.sphere.visible = self.on_sphere
        if self._room is not None:
            self._room.visible = looked == "in its room"
        self._draw_edges()
        if in_room:
            eye = self._room_eye_m if looked == "in its room" else SPHERE_EYE_M
            for client in self._server.get_clients().values():
                client.camera.position, client.camera.look_at = eye, (0.0, 0.0, 0.0)

    def stand_in(self, task: Task) -> None:
        """Put up the room of a task, in the colour of what has none yet."""
        room = room_about(task)
        before = self._placeholder
        if before is not None and np.array_equal([before.low, before.high], [room.low, room.high]):
            return  # paint changes what counts, and no wall
        self._placeholder, self.room = room, room_tiles(room)
        x, y, z = room.high - room.low
        self._room_eye_m = (float(-0.8 * x), float(0.8 * y), float(0.5 * (x + z)))
        self._server.initial_camera.position = self._room_eye_m
        self._room = self._scene.add_batched_meshes_simple(
            "/room",
            self.room.corners_m,
            self.room.faces,
            self.room.wxyz,
            self.room.middles_m,
            batched_colors=_blank(self.room.middles_m),
            side="front",
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=self._looked == "in its room",
        )
        self._draw_edges()

    @property
    def on_sphere(self) -> bool:
        """Whether the sphere is shown."""
        return self._looked == "sphere"

    def colour(self, problem: Problem, setting: Setting, bands: Bands) -> None:
        """Colour the tiles by the density of a setting, and show its axis and fan."""
        if self._looked == "in its room" and self._room is not None:
            painted, directions, normals = self._room, self.room.directions, self.room.normals
        else:
            painted, directions = self.sphere, self.tiles.directions
            normals = -directions
        density = mean_density_at(problem, setting.angles_rad, directions)
        painted.batched_colors = unlit(density_colours(density, bands), normals)
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
        self._edges = edges(problem.field)
        self._draw_edges()

    def _draw_edges(self) -> None:
        """Where the density is shown; the words too."""
        for name, segments, colour in zip(("weight", "mask"), self._edges, (WEIGHT_EDGE, MASK_EDGE), strict=False):
            node = f"/edge/{name}"
            if len(segments) and self._looked != "hidden":
                self._scene.add_line_segments(
                    node,
                    self._shown_at(segments).astype(np.float32),
                    colors=colour,
                    thickness=3.0,
                    thickness_units="screen",
                )
            else:
                self._scene.remove_by_name(node)
        for direction, mark in self._marks.items():
            mark.position = tuple((MARK * self._shown_at(np.array(direction))).tolist())

    def _shown_at(self, directions: Array) -> Array:
        """Where directions are drawn: just before the walls of the room or the tiles of the sphere, shape (..., 3)."""
        if self._looked == "in its room" and self._placeholder is not None:
            return (1 - LIFT) * self._placeholder.walls_along(directions)
        return RADIUS_M * (1 - LIFT) * directions

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

    def fade_bodies(self, turning: bool) -> None:
        """One half of the scanner is an earlier setting's: a ghost, until `show_bodies` puts up the new one."""
        for handle in self._bodies[turning]:
            handle.opacity = GHOST

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


def _blank(tiles: Array) -> Colours:
    """A colour for each tile from the first: a browser that got one for all complains of the many that follow."""
    return np.full((len(tiles), 3), 200, np.uint8)
