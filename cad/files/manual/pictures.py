"""The picture of each step: present bodies in grey, new ones in colour before they are moved into place, screws named.

The rotation axis is upright, on the bench the lidar's axis. Of eight sides, from above and below, the view is the one
that shows the heads of the screws best, or that shows most of the cables in place; else it is the first.
"""

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from scanwright.cad.assembly.scenes import StepScene
from scanwright.cad.drawings.dimensions import spread
from scanwright.cad.geometry.mesh import TriMesh
from scanwright.cad.layout.joints import Joint
from scanwright.cad.layout.names import DECK, SERVO_CASE
from scanwright.cad.screws import Screw
from scanwright.design.arrays import Array, Vector
from scanwright.design.scene.parallel_view import ParallelView, view_of
from scanwright.design.scene.ray_caster import Scene, build_scene

SIZE_PX = 720, 480  # pixels, wide and high
SMALL_PX = 128, 120  # of a picture that only counts what is visible
WORDS_PX = 210  # of them at the right, for the screws
TEXT_PX, LINE_PX = 15, 20
MARGIN = 1.06
YAWS_RAD = tuple(math.radians(40.0 + 45.0 * i) for i in range(8))  # the first as in the report
PITCHES_RAD = math.radians(22.0), math.radians(-22.0)
BELOW = 0.15  # by which a view from below must be better
GAP_MM = 12.0  # between new and present bodies
OUT_MM = 8.0  # of screws and nuts, from their final place
SIDES = 24
GREY, MADE, BOUGHT, METAL, PLACED = (
    np.array(c, float) for c in ((222, 222, 219), (226, 112, 30), (44, 110, 168), (70, 70, 74), (150, 150, 152))
)
WASHER_MM = 0.6  # drawn thickness
INK, ARROW, LIGHT = (20, 20, 20), (170, 20, 20), (255, 255, 255)
EDGE = 0.45  # of a body's colour, at its outline
STEP_M = 0.0015  # between two distances that are an edge
COLOURS = 64


@dataclass(frozen=True, slots=True)
class Piece:
    """Something to draw."""

    scene: Scene  # its triangles
    moved_m: Vector  # displacement
    colour: Array  # sRGB, 0 to 255


def painted(view: ParallelView, pieces: Sequence[Piece]) -> Image.Image:
    """Draw the bodies by their distances, each with a dark edge."""
    columns, rows = view.size
    away = np.full(columns * rows, np.inf)
    which = np.full(columns * rows, -1)
    colour = np.full((columns * rows, 3), 255.0)
    for i, piece in enumerate(pieces):
        shown = view.shown(piece.scene, piece.moved_m)
        front = shown.away_m < away
        away[front], which[front] = shown.away_m[front], i
        colour[front] = shown.brightness[front, None] * piece.colour
    edge = _edges(np.where(np.isfinite(away), away, 1e3).reshape(rows, columns), which.reshape(rows, columns))
    colour[edge.reshape(-1)] *= EDGE
    return Image.fromarray(colour.reshape(rows, columns, 3).round().astype(np.uint8))


def _edges(away: Array, which: Array) -> Array:
    """Return the pixels of a nearer body at the border to another one, or to a farther piece of itself."""
    edge = np.zeros(away.shape, bool)
    for axis in (0, 1):
        for turn in (1, -1):
            other = np.roll(away, turn, axis)
            apart = (np.roll(which, turn, axis) != which) | (other - away > STEP_M)
            edge |= apart & (away < other) & (which >= 0)
    return edge


def rod(start: Vector, along: Vector, radius: float, length: float, sides: int) -> Array:
    """Return a closed prism about an axis: triangles, shape (4 sides, 3, 3), in the unit of `start`."""
    helper = np.eye(3)[int(np.argmin(np.abs(along)))]
    x = np.cross(helper, along)
    x /= np.linalg.norm(x)
    turn = 2 * math.pi * np.arange(sides) / sides
    near = start + radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * np.cross(along, x))
    far, after = near + length * along, np.roll(np.arange(sides), -1)
    middle = [np.broadcast_to(start, near.shape), np.broadcast_to(start + length * along, near.shape)]
    fans = [(near, near[after], far[after]), (near, far[after], far), (near, near[after], middle[0])]
    return np.concatenate([np.stack(fan, axis=1) for fan in (*fans, (far, far[after], middle[1]))])


def png_bytes(image: Image.Image) -> bytes:
    """Return the file of a picture, in few colours."""
    file = io.BytesIO()
    image.quantize(COLOURS).save(file, "PNG")
    return file.getvalue()


class StepPictures:
    """Pictures of the steps of one scanner; a body is prepared once for all of them."""

    def __init__(self, meshes: dict[str, TriMesh], made: frozenset[str]) -> None:
        self._meshes, self._made = meshes, made
        self._scenes: dict[str, Scene] = {}

    def picture(self, scene: StepScene, torques: Sequence[str], before: Sequence[StepScene] = ()) -> bytes:
        """Return the PNG of one step; `torques` belong to its screws, joint by joint; `before`: the earlier steps."""
        groups = {sign: [name for name in scene.comes if (name in scene.against) == (sign < 0)] for sign in (1.0, -1.0)}
        shifts = {sign: self._lift(scene, names, sign * scene.along) for sign, names in groups.items() if names}
        known = {name for step in before for name in (*step.there, *step.comes)}
        colours = {name: MADE if name in self._made else BOUGHT for name in (*scene.there, *scene.comes)}
        pieces = [self._piece(name, np.zeros(3), GREY if name in known else colours[name]) for name in scene.there]
        for sign, shift in shifts.items():
            pieces += [self._piece(name, shift, colours[name]) for name in groups[sign]]
        moved_by = {name: shifts[sign] for sign, names in groups.items() for name in names}
        placed = [(joint, moved_by.get(joint.part, np.zeros(3))) for joint, _ in scene.joints]
        for joint, moved in placed:
            pieces += [Piece(build_scene(body), moved, METAL) for body in _screws(joint, _out(joint))]
            beyond = moved if joint.onto in (DECK, SERVO_CASE) else moved_by.get(joint.onto, np.zeros(3))
            pieces += [Piece(build_scene(body), beyond, METAL) for body in _nuts(joint, OUT_MM)]
        pieces += _placed(scene, [joint for step in before for joint, _ in step.joints], moved_by)
        corners = np.concatenate([piece.scene.triangles_m.reshape(-1, 3) + piece.moved_m for piece in pieces])
        width, height = SIZE_PX
        yaw, pitch = _side(scene) if np.any(scene.along) else _clearest(scene, corners, pieces)
        view = view_of(corners, (width - WORDS_PX, height), yaw, pitch, MARGIN, scene.R_rot_picture)
        image = Image.new("RGB", SIZE_PX, LIGHT)
        image.paste(painted(view, pieces), (0, 0))
        pen = ImageDraw.Draw(image)
        for sign, shift in shifts.items():
            if np.any(shift):
                self._move_arrow(pen, view, groups[sign], shift)
        _call_out(pen, view, placed, torques)
        return png_bytes(image)

    def _piece(self, name: str, moved_m: Vector, colour: Array) -> Piece:
        if name not in self._scenes:
            mesh = self._meshes[name]
            self._scenes[name] = build_scene(mesh.vertices[mesh.faces] / 1000, name)
        return Piece(self._scenes[name], moved_m, colour)

    def _lift(self, scene: StepScene, comes: Sequence[str], along: Vector) -> Vector:
        """Return the displacement of new bodies [m] that clears all present ones."""
        if not scene.there:
            return np.zeros(3)
        top = max(float((self._meshes[name].vertices @ along).max()) for name in scene.there)
        low = min(float((self._meshes[name].vertices @ along).min()) for name in comes)
        return (max(0.0, top - low) + GAP_MM) / 1000 * along

    def _move_arrow(self, pen: ImageDraw.ImageDraw, view: ParallelView, comes: Sequence[str], shift: Vector) -> None:
        """Draw an arrow next to new bodies, from their middle to its final place."""
        points = np.concatenate([self._meshes[name].vertices for name in comes]) / 1000
        flat = view.at(points + shift)
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        start, end = view.at(middle + shift), view.at(middle)
        across = np.array([-(end - start)[1], (end - start)[0]]) / max(1.0, float(np.hypot(*(end - start))))
        aside = across * ((flat - start) @ across).max() + 8 * across
        inside = [np.clip(point + aside, 8, [view.size[0] - 8, view.size[1] - 8]) for point in (start, end)]
        _arrow(pen, inside[0], inside[1])


def _side(scene: StepScene) -> tuple[float, float]:
    """Return the yaw and pitch [rad] of the view that shows most of the heads, preferably from above."""
    heads = [-np.array(axis.along) @ scene.R_rot_picture for joint, _ in scene.joints for axis in joint.axes]

    def seen(yaw: float, pitch: float) -> float:
        back = [math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)]
        return round(float(np.mean([head @ back for head in heads])) - BELOW * (pitch < 0), 3) if heads else -pitch

    if not heads:
        return YAWS_RAD[0], PITCHES_RAD[0]
    return max(((yaw, pitch) for pitch in PITCHES_RAD for yaw in YAWS_RAD), key=lambda side: seen(*side))


def _clearest(scene: StepScene, corners: Array, pieces: Sequence[Piece]) -> tuple[float, float]:
    """Return the yaw and pitch [rad] of the view in which most of the new bodies is visible, preferably from above."""

    def seen(yaw: float, pitch: float) -> float:
        view = view_of(corners, SMALL_PX, yaw, pitch, MARGIN, scene.R_rot_picture)
        away = np.stack([view.shown(piece.scene, piece.moved_m).away_m for piece in pieces])
        new = np.array([piece.colour is not GREY and piece.colour is not PLACED for piece in pieces])
        pixels = np.isfinite(away.min(axis=0)) & new[away.argmin(axis=0)]
        return float(pixels.sum()) * view.pixel_m**2 * (1.0 - BELOW * (pitch < 0))

    return max(((yaw, pitch) for pitch in PITCHES_RAD for yaw in YAWS_RAD), key=lambda side: seen(*side))


def _placed(scene: StepScene, earlier: Sequence[Joint], moved_by: Mapping[str, Vector]) -> Iterator[Piece]:
    """Yield the screws and nuts of earlier steps that are on the bodies of a step."""
    for joint in earlier:
        if joint.part in moved_by or joint.part in scene.there:
            moved = moved_by.get(joint.part, np.zeros(3))
            yield Piece(build_scene(np.concatenate([*_screws(joint, 0.0), *_nuts(joint, 0.0)])), moved, PLACED)


def _screws(joint: Joint, out: float) -> list[Array]:
    """Return triangles of screws [m], each of shape (t, 3, 3), at a distance [mm] before their final place."""
    axes = [(np.array(axis.start), np.array(axis.along)) for axis in joint.axes]
    return [_screw(joint, start - out * along, along) / 1000 for start, along in axes]


def _nuts(joint: Joint, out: float) -> list[Array]:
    """Return triangles of loose nuts [m], each of shape (t, 3, 3), at a distance [mm] from their face."""
    if joint.fixing not in ("nut", "deck"):
        return []
    size, off = joint.screw, joint.grip_mm + joint.thread_mm + out
    axes = [(np.array(axis.start), np.array(axis.along)) for axis in joint.axes]
    return [
        rod(start + off * along, along, size.nut_across / math.sqrt(3), size.nut_height, 6) / 1000
        for start, along in axes
    ]


def _out(joint: Joint) -> float:
    return joint.length_mm + OUT_MM


def _screw(joint: Joint, under_head: Vector, along: Vector) -> Array:
    screw: Screw = joint.screw
    shank = rod(under_head, along, screw.nominal / 2, joint.length_mm, SIDES)
    if joint.fixing == "grub":
        return shank
    bodies = [shank, rod(under_head, -along, screw.head_diameter / 2, screw.head_height, SIDES)]
    if joint.washer_mm is not None:
        bodies.append(rod(under_head, -along, joint.washer_mm / 2, WASHER_MM, SIDES))
    return np.concatenate(bodies)


def _arrow(pen: ImageDraw.ImageDraw, start: Array, end: Array) -> None:
    arrow = end - start
    length = float(np.hypot(*arrow))
    if length < 12:
        return
    along = arrow / length
    across = np.array([-along[1], along[0]])
    for wide, colour in ((7, LIGHT), (3, ARROW)):
        pen.line([*start, *(end - 8 * along)], fill=colour, width=wide)
    pen.polygon([tuple(p) for p in (end, end - 14 * along + 6 * across, end - 14 * along - 6 * across)], fill=ARROW)


def _call_out(
    pen: ImageDraw.ImageDraw, view: ParallelView, placed: Sequence[tuple[Joint, Vector]], torques: Sequence[str]
) -> None:
    """Draw a thin line from each screw along its path, and the text at the right with a leader to the nearest screw."""
    font, callouts = ImageFont.load_default(TEXT_PX), []
    for (joint, moved), torque in zip(placed, torques, strict=True):
        heads = []
        for axis in joint.axes:
            start, along = np.array(axis.start) / 1000, np.array(axis.along)
            straight = float(np.linalg.norm(np.cross(moved, along))) < 1e-6  # else it bends at the part's final place
            end = start + (0 if straight else moved)
            heads.append(view.at(start - _out(joint) / 1000 * along + moved))
            pen.line([*view.at(start - OUT_MM / 1000 * along + moved), *view.at(end)], fill=INK, width=1)
        callouts.append((max(heads, key=lambda head: round(float(head[0]), 3)), _lines_of(joint, torque)))
    callouts.sort(key=lambda item: (float(item[0][1]), item[1]))
    places = spread([float(head[1]) for head, _ in callouts], 4.5 * LINE_PX)
    over = max(0.0, max(places, default=0.0) + 4 * LINE_PX - view.size[1])
    left = view.size[0]
    for (head, words), place in zip(callouts, places, strict=True):
        y = max(place - over, LINE_PX)
        pen.line([*head, left + 6, y, left + 12, y], fill=INK, width=1)
        for i, word in enumerate(words):
            pen.text((left + 16, y + i * LINE_PX), word, fill=INK, font=font, anchor="lm")


def _lines_of(joint: Joint, torque: str) -> tuple[str, ...]:
    """Return a joint in a few short lines."""
    held = f"{'washers, ' * (joint.washer_mm is not None)}{torque}"
    if joint.fixing == "trap":
        return (
            f"{joint.count} x {joint.number}",
            held,
            f"onto {joint.count} nuts {joint.screw.name}",
            f"in {joint.onto}",
        )
    nuts = (f"{joint.count} nuts {joint.screw.name}",) if joint.fixing in ("nut", "deck") else ()
    where = "against" if joint.fixing == "grub" else "into"
    return f"{joint.count} x {joint.number}", held, f"{where} {joint.onto}", *nuts
