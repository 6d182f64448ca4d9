"""A cable as a solid: a round section along its path, thicker at its joint. Millimetres."""

import cadquery as cq
import numpy as np

from scanwright.cad import solids
from scanwright.cad.geometry.mesh import mesh_of
from scanwright.cad.layout.cables import joint
from scanwright.cad.layout.cables.fixed import FixedCable
from scanwright.cad.layout.cables.leads import RotorLead
from scanwright.cad.layout.cables.path import Path
from scanwright.cad.layout.names import ROTOR_LEAD
from scanwright.cad.solids import building
from scanwright.design.errors import BuildError

LEAD_CHORDS = (0.1, 0.5)  # of its mesh, in mm and rad: a bundle of wires is not as round as a bore


def lead_solid(lead: RotorLead) -> cq.Solid:
    """Return the wires between ring and lidar with the shrink tube over their joint.

    Raises:
        BuildError: the kernel does not make one valid solid of it, with a closed mesh.
    """
    assert lead.path is not None
    with building(ROTOR_LEAD, "tube along its path", "diameter", f"{lead.diameter:g} mm") as checked:
        tube: cq.Shape = _tube(lead.path, lead.diameter / 2)
        if lead.joint is not None:
            along = lead.joint.along
            start = lead.joint.middle - joint.LENGTH / 2 * along
            tube = tube.fuse(solids.cylinder(lead.diameter / 2 + joint.WALL, start, along, joint.LENGTH))
        return _closed(ROTOR_LEAD, checked(tube))


def cable_solid(cable: FixedCable) -> cq.Solid:
    """Return a cable that does not turn.

    Raises:
        BuildError: the kernel does not make one valid solid of it, with a closed mesh.
    """
    assert cable.path is not None
    with building(cable.name, "tube along its path", "diameter", f"{cable.diameter:g} mm") as checked:
        return _closed(cable.name, checked(_tube(cable.path, cable.diameter / 2)))


def _closed(name: str, solid: cq.Solid) -> cq.Solid:
    if not mesh_of(solid, *LEAD_CHORDS).is_closed():
        raise BuildError(f"{name}: mesh: tolerance = {LEAD_CHORDS[0]} mm: the surface is not closed")
    return solid


def _tube(path: Path, half: float) -> cq.Shape:
    corners = np.array(path.corners, dtype=float)
    edges = []
    for piece in path.pieces():
        start, middle, end = (solids.vector(point) for point in (piece.start, piece.middle, piece.end))
        line = cq.Edge.makeLine(start, end) if piece.straight else cq.Edge.makeThreePointArc(start, middle, end)
        edges.append(line)
    wire = cq.Wire.assembleEdges(edges)
    ring = cq.Wire.makeCircle(half, solids.vector(corners[0]), solids.vector(corners[1] - corners[0]))
    return cq.Solid.sweep(ring, [], wire)
