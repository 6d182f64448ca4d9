"""Making the parts of one scanner, and the bought bodies around them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.bought import BodySpec, bought_of
from scanwright.cad.assembly.masses import rotor_moment
from scanwright.cad.assembly.print_beds import require_room_on_bed
from scanwright.cad.layout.layout import Layout
from scanwright.cad.layout.names import COUNTERWEIGHT
from scanwright.cad.parts.all_parts import laid_out, parts_of
from scanwright.cad.parts.counterweight import bar_spec
from scanwright.cad.parts.part_spec import PartSpec
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

Wanted = Callable[[PartSpec | BodySpec], bool]


def make_parts(scanner: Scanner, wanted: Wanted = lambda _: True) -> Assembly:
    """Make every part that this scanner needs, and the bought ones around them; of these, those that are wanted.

    Raises:
        BuildError: a part cannot be made, or fits no bed of the printer; the message names part, feature, parameter and
            value.
    """
    return made_from(laid_out(scanner), wanted)


def made_from(layout: Layout, wanted: Wanted = lambda _: True) -> Assembly:
    """The same, of a layout."""
    parts = {spec.name: spec for spec in parts_of(layout) if not isinstance(spec, LeftOut)}
    bodies = {spec.name: spec for spec in bought_of(layout)}
    last = parts.pop(COUNTERWEIGHT, None)
    made = {name: spec.make() for name, spec in parts.items() if wanted(spec)}
    bought = {name: spec.make() for name, spec in bodies.items() if wanted(spec)}
    assembly = Assembly(layout, parts, bodies, made, bought)
    require_room_on_bed(assembly)
    return assembly if last is None or not wanted(last) else _balanced(assembly)


def _balanced(assembly: Assembly) -> Assembly:
    """With the counterweight, cut to the solids; without linkage and sub-plate, to their estimate."""
    layout = assembly.layout
    bar = layout.counterweight
    assert not isinstance(bar, LeftOut)
    if len(assembly.carriers()) == sum(part.seat is not None for part in assembly.parts.values()):
        bar = bar.balancing(rotor_moment(layout.scanner, assembly))
    spec = bar_spec(layout, bar)
    parts, made = assembly.parts | {spec.name: spec}, assembly.made | {spec.name: spec.make()}
    return replace(assembly, parts=parts, made=made)
