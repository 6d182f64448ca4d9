"""Making the parts of one scanner, and the bought bodies around them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from scanwright.cad.assembly.assembly import Assembly, rotor_moment
from scanwright.cad.assembly.bought import BodySpec, bought_of
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import BASE_MOUNT, COUNTERWEIGHT, TRIPOD_FOOT
from scanwright.cad.parts.all_parts import laid_out, parts_of
from scanwright.cad.parts.linkage.counterweight import bar_spec
from scanwright.cad.parts.part_spec import PartSpec
from scanwright.design.errors import BuildError
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

SLACK_MM = 0.01  # the noise of meshes
Wanted = Callable[[PartSpec | BodySpec], bool]


def make_parts(scanner: Scanner, wanted: Wanted = lambda _: True) -> Assembly:
    """Make the parts of a scanner and the bought bodies, limited to those that are `wanted`.

    Raises:
        BuildError: a part cannot be made, or fits no bed of the printer; the message names part, feature, parameter and
            value.
    """
    return made_from(laid_out(scanner), wanted)


def made_from(layout: Layout, wanted: Wanted = lambda _: True) -> Assembly:
    """Return the parts of a layout; `wanted` as for `make_parts`."""
    parts = {spec.name: spec for spec in parts_of(layout) if not isinstance(spec, LeftOut)}
    bodies = {spec.name: spec for spec in bought_of(layout)}
    last = parts.pop(COUNTERWEIGHT, None)
    made = {name: spec.make() for name, spec in parts.items() if wanted(spec)}
    bought = {name: spec.make() for name, spec in bodies.items() if wanted(spec)}
    assembly = Assembly(layout, parts, bodies, made, bought)
    if last is not None and wanted(last):
        assembly = _balanced(assembly)
    require_bed(assembly)  # it makes meshes, which the balanced assembly would not keep
    return assembly


def _balanced(assembly: Assembly) -> Assembly:
    """Return the assembly with its counterweight, cut to the solids, or to their estimate if some are missing."""
    layout = assembly.layout
    bar = layout.counterweight
    assert not isinstance(bar, LeftOut)
    if len(assembly.carriers()) == sum(part.seat is not None for part in assembly.parts.values()):
        bar = bar.balancing(rotor_moment(assembly))  # all other parts are there
    spec = bar_spec(layout, bar)
    parts, made = assembly.parts | {spec.name: spec}, assembly.made | {spec.name: spec.make()}
    return replace(assembly, parts=parts, made=made)


def require_bed(assembly: Assembly) -> None:
    """Require a bed for every made part that is printed.

    Raises:
        BuildError: one fits the bed of this printer in no pose; the message contains its size and remedies.
    """
    printer = assembly.layout.scanner.printer
    for name in assembly.made:
        if assembly.parts[name].metal or _across(assembly, name) <= min(printer.bed_mm):
            continue
        if (pose := assembly.print_pose(name)).fits:
            continue
        size, bed = (" x ".join(f"{edge:.0f}" for edge in edges) for edges in (pose.size_mm, printer.bed_mm))
        least = [float(np.ceil(edge - SLACK_MM)) for edge in pose.size_mm]
        smaller = ", or a smaller pattern of holes in [deck]" if name in (BASE_MOUNT, TRIPOD_FOOT) else ""
        raise BuildError(
            f"{name}: {size} mm in its print pose: the bed of {printer.name} is {bed} mm (bed_mm); use a printer with "
            f"bed_mm = {least}{smaller}, or other angles"
        )


def _across(assembly: Assembly, name: str) -> float:
    """Return the diameter of a ball around a part: a bed as wide holds it in any pose."""
    vertices = assembly.mesh(name).vertices
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    return 2 * float(np.linalg.norm(vertices - middle, axis=1).max())
