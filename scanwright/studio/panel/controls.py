"""The controls of the panel; `page` connects them."""

from __future__ import annotations

from typing import Any, Literal, get_args

import viser

from scanwright.design.task.angle_ranges import NAMES
from scanwright.design.task.task import LoadedTask
from scanwright.serving.style import banner_html
from scanwright.studio.panel.pads import pads_html
from scanwright.studio.state import BOUNDS_DEG, Brush, Setting

NO_SCENE, ROOM, TASK_SCENE = "none", "furnished room", "scene of the task"
UNDO, REDO = "Undo", "Redo"
LOST = "The studio has ended: this page is out of date.", "Start it again, then reload this page."
QUIET: Literal["gray"] = "gray"  # secondary buttons
BRUSHES: tuple[Brush, ...] = get_args(Brush)


class Controls:
    """Handles of all controls, put up for a task with the angles of a setting."""

    def __init__(self, gui: viser.GuiApi, loaded: LoadedTask, setting: Setting) -> None:
        self.banner = gui.add_html(banner_html("running", (), lost=LOST))
        self.facts, self.mode, self.note, self.making = (gui.add_html("") for _ in range(4))
        self.undo = gui.add_button(UNDO, icon=viser.Icon.ARROW_BACK_UP, color=QUIET, disabled=True)
        self.redo = gui.add_button(REDO, icon=viser.Icon.ARROW_FORWARD_UP, color=QUIET, disabled=True)
        self.undo_key = gui.add_command(UNDO, hotkey="Z", modifier="cmd/ctrl", disabled=True)
        self.redo_key = gui.add_command(REDO, hotkey="Z", modifier="cmd/ctrl+shift", disabled=True)
        self.brush_key = gui.add_command("Brush", description="Turn the brush on or off", hotkey="B")
        tabs = gui.add_tab_group()
        with tabs.add_tab("Angles"):
            self.pads = gui.add_html(pads_html(None))
            self.angles = tuple(
                gui.add_slider(name, -bound, bound, 0.01, angle)
                for name, bound, angle in zip(NAMES, BOUNDS_DEG, setting.angles_deg, strict=True)
            )
            self.typed = gui.add_text("angles [deg]", setting.text, hint="All four; a link to this page contains them")
            self.typed_error = gui.add_html("")
            self.link = gui.add_button("Copy link", hint="It opens this setting, also after a restart", color=QUIET)
            self.optimise = gui.add_button(
                "Optimise", hint="Search all angles of the task, and move the sliders to the optimum"
            )
            self.progress = gui.add_progress_bar(0.0, visible=False)
            self.keep = gui.add_button("Keep this setting", hint="Add it to the table under Compare", color=QUIET)
            self.scale = gui.add_html("")
        with tabs.add_tab("Paint"):
            self.painting = gui.add_checkbox(
                "brush", initial_value=False, hint="Click or drag on the walls; off: turn the view"
            )
            self.brush = gui.add_dropdown("paints", BRUSHES, initial_value=BRUSHES[0])
            self.radius = gui.add_slider("radius [deg]", 1.0, 60.0, 0.5, 12.0)
            self.weight = gui.add_number("weight", 1.0, min=0.01, max=1000.0, step=0.1)
            self.clear = gui.add_button("Clear paint", color=QUIET)
            self.painted = gui.add_html("")
        with tabs.add_tab("Compare"):
            self.table = gui.add_html("")
            self.kept = gui.add_dropdown("setting", ("rolling",), initial_value="rolling")
            self.restore, self.remove = gui.add_button("Restore", color=QUIET), gui.add_button("Remove", color=QUIET)
        scenes = (NO_SCENE, ROOM) if loaded.task.scene is None else (NO_SCENE, ROOM, TASK_SCENE)
        with tabs.add_tab("View"):
            self.density = gui.add_checkbox("density", initial_value=True)
            self.scanner = gui.add_checkbox("scanner", initial_value=True)
            self.scene = gui.add_dropdown("scan of", scenes, initial_value=NO_SCENE)
        with tabs.add_tab("Save"):
            self.name = gui.add_text("name", f"{loaded.task.name}_mine"[:64])
            self.name_error = gui.add_html("")
            self.fixed = gui.add_checkbox(
                "fix these angles", initial_value=False, hint="Write these angles instead of ranges to search"
            )
            self.overwrite = gui.add_checkbox("overwrite", initial_value=False)
            self.save, self.build = gui.add_button("Save task", color=QUIET), gui.add_button("Save and build")
            self.building = gui.add_progress_bar(0.0, visible=False)
            self.built = gui.add_html("")

        self.fields: dict[str, viser.GuiInputHandle[Any]] = {
            "paints": self.brush,
            "radius": self.radius,
            "weight": self.weight,
            "name": self.name,
            "fix these angles": self.fixed,
            "overwrite": self.overwrite,
        }

    def show_steps(self, undoes: str, redoes: str) -> None:
        """Label undo and redo with their steps; an empty step disables them."""
        for button, key, name, words in (
            (self.undo, self.undo_key, UNDO, undoes),
            (self.redo, self.redo_key, REDO, redoes),
        ):
            button.label = key.label = f"{name}: {words}" if words else name
            button.disabled = key.disabled = not words


def put(control: Any, value: object) -> None:
    """Set the value of a control, which viser declares as read-only."""
    control.value = value
