"""Making the parts of one scanner, and the bought bodies around them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.assembly.beds import refuse_what_no_bed_holds
from scanwright.cad.assembly.bought import BodySpec, bought_of
from scanwright.cad.assembly.masses import rotor_moment
from scanwright.cad.layout.cables.leads import leads_of
from scanwright.cad.layout.cables.standing import standing_leads_of
from scanwright.cad.layout.layout import layout_of
from scanwright.cad.layout.names import COUNTERWEIGHT
from scanwright.cad.parts.all_parts import parts_of
from scanwright.cad.parts.counterweight import counterweight_spec
from scanwright.cad.parts.part_spec import PartSpec
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

Wanted = Callable[[PartSpec | BodySpec], bool]


def make_parts(scanner: Scanner, wanted: Wanted = lambda _: True) -> Assembly:
    """Make every part that this scanner needs, and the bought ones around them; of these, those that are wanted.

    Raises:
        BuildError: a part cannot be made, or lies on no bed of the printer; the message names part, feature, parameter
            and value.
    """
    layout = layout_of(scanner)
    parts = {spec.name: spec for spec in parts_of(layout)}
    leads, standing = leads_of(layout), standing_leads_of(layout)
    bodies = {spec.name: spec for spec in bought_of(layout, leads, standing)}
    last = parts.pop(COUNTERWEIGHT, None)
    made = {name: spec.make() for name, spec in parts.items() if wanted(spec)}
    bought = {name: spec.make() for name, spec in bodies.items() if wanted(spec)}
    assembly = Assembly(layout, parts, bodies, made, bought, leads, standing)
    refuse_what_no_bed_holds(assembly)
    return assembly if last is None or not wanted(last) else _balanced(assembly)


def _balanced(assembly: Assembly) -> Assembly:
    """With the counterweight, cut to the solids; without linkage and sub-plate, to their estimate."""
    layout = assembly.layout
    bar = layout.counterweight
    assert not isinstance(bar, LeftOut)
    if len(assembly.carriers()) == sum(part.seat is not None for part in assembly.parts.values()):
        bar = bar.balancing(rotor_moment(layout.scanner, assembly))
    layout = replace(layout, counterweight=bar)
    spec = counterweight_spec(layout)
    assert spec is not None
    parts, made = assembly.parts | {spec.name: spec}, assembly.made | {spec.name: spec.make()}
    return replace(assembly, layout=layout, parts=parts, made=made)
