"""The panel: every control of the studio, where it stands and what it may hold. What they do is in `page`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import viser
from viser._gui_handles import GuiProgressBarHandle

from design.task.task import LoadedTask
from scanwright.studio.state import Setting

LABELS = (("alpha_rot", 180.0), ("beta_rot", 90.0), ("alpha_laser", 90.0), ("beta_laser", 90.0))
NO_SCENE, ROOM, TASK_SCENE = "none", "furnished room", "scene of the task"
BRUSHES = ("matters", "does not matter", "hidden")
LOOKS = ("from inside", "from outside", "hidden")


@dataclass(frozen=True, slots=True)
class Controls:
    """Handles of all controls."""

    facts: viser.GuiHtmlHandle
    note: viser.GuiHtmlHandle
    making: viser.GuiHtmlHandle
    task: viser.GuiDropdownHandle[str]
    angles: tuple[viser.GuiSliderHandle[float], ...]
    optimise: viser.GuiButtonHandle
    keep: viser.GuiButtonHandle
    progress: GuiProgressBarHandle
    scale: viser.GuiHtmlHandle
    painting: viser.GuiCheckboxHandle
    brush: viser.GuiDropdownHandle[str]
    radius: viser.GuiSliderHandle[float]
    weight: viser.GuiNumberHandle[float]
    undo: viser.GuiButtonHandle
    clear: viser.GuiButtonHandle
    painted: viser.GuiHtmlHandle
    table: viser.GuiHtmlHandle
    kept: viser.GuiDropdownHandle[str]
    restore: viser.GuiButtonHandle
    remove: viser.GuiButtonHandle
    look: viser.GuiDropdownHandle[str]
    scanner: viser.GuiCheckboxHandle
    scene: viser.GuiDropdownHandle[str]
    name: viser.GuiTextHandle
    fixed: viser.GuiCheckboxHandle
    overwrite: viser.GuiCheckboxHandle
    save: viser.GuiButtonHandle
    build: viser.GuiButtonHandle
    building: GuiProgressBarHandle
    built: viser.GuiHtmlHandle


def lay_out(gui: viser.GuiApi, loaded: LoadedTask, tasks: list[str], setting: Setting) -> Controls:
    """Put up the panel for a task, with the angles of a setting."""
    facts, note, making = gui.add_html(""), gui.add_html(""), gui.add_html("")
    tabs = gui.add_tab_group()
    with tabs.add_tab("Angles"):
        task = gui.add_dropdown("task", tasks, initial_value=tasks[0])
        angles = tuple(
            gui.add_slider(name, -bound, bound, 0.01, angle)
            for (name, bound), angle in zip(LABELS, setting.angles_deg, strict=True)
        )
        optimise = gui.add_button("Optimise", hint="Search all angles of the task, and move the sliders there")
        progress = gui.add_progress_bar(0.0, visible=False)
        keep = gui.add_button("Keep this setting", hint="Put it into the table under Compare")
        scale = gui.add_html("")
    with tabs.add_tab("Paint"):
        painting = gui.add_checkbox(
            "brush", initial_value=False, hint="Click or drag on the sphere; off: turn the view"
        )
        brush = gui.add_dropdown("paints", BRUSHES, initial_value=BRUSHES[0])
        radius = gui.add_slider("radius [deg]", 1.0, 60.0, 0.5, 12.0)
        weight = gui.add_number("weight", 1.0, min=0.01, max=1000.0, step=0.1)
        undo, clear = gui.add_button("Undo"), gui.add_button("Clear")
        painted = gui.add_html("")
    with tabs.add_tab("Compare"):
        table = gui.add_html("")
        kept = gui.add_dropdown("setting", ("rolling", "pitching"), initial_value="rolling")
        restore, remove = gui.add_button("Restore"), gui.add_button("Remove")
    with tabs.add_tab("View"):
        look = gui.add_dropdown("sphere", LOOKS, initial_value=LOOKS[0])
        scanner = gui.add_checkbox("scanner", initial_value=True)
        scene = gui.add_dropdown("scan of", scenes_of(loaded), initial_value=NO_SCENE)
    with tabs.add_tab("Save"):
        name = gui.add_text("name", f"{loaded.task.name}_mine"[:64])
        fixed = gui.add_checkbox("fix these angles", initial_value=False, hint="Write the angles in place of ranges")
        overwrite = gui.add_checkbox("overwrite", initial_value=False)
        save = gui.add_button("Save task")
        build = gui.add_button("Save and build")
        building = gui.add_progress_bar(0.0, visible=False)
        built = gui.add_html("")
    return Controls(
        facts=facts,
        note=note,
        making=making,
        task=task,
        angles=angles,
        optimise=optimise,
        keep=keep,
        progress=progress,
        scale=scale,
        painting=painting,
        brush=brush,
        radius=radius,
        weight=weight,
        undo=undo,
        clear=clear,
        painted=painted,
        table=table,
        kept=kept,
        restore=restore,
        remove=remove,
        look=look,
        scanner=scanner,
        scene=scene,
        name=name,
        fixed=fixed,
        overwrite=overwrite,
        save=save,
        build=build,
        building=building,
        built=built,
    )


def put(control: Any, value: object) -> None:
    """Set what a control holds; viser declares that in a way that type checkers take for read-only."""
    control.value = value


def scenes_of(loaded: LoadedTask) -> tuple[str, ...]:
    """What a scan can be simulated of."""
    return (NO_SCENE, ROOM, TASK_SCENE) if loaded.task.scene is not None else (NO_SCENE, ROOM)
