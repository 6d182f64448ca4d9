"""Unverified values of the products, and required modules that do not fit."""

from collections.abc import Iterable, Iterator

from scanwright.cad.assembly.assembly import Assembly
from scanwright.cad.layout.names import COUNTERWEIGHT
from scanwright.design.catalogue.holes import Hole, what_holds
from scanwright.design.catalogue.measuring import how_to_measure
from scanwright.design.catalogue.product_base import Product
from scanwright.design.findings import Finding
from scanwright.design.left_out import LeftOut
from scanwright.design.scanner import Scanner

# Values of a product that shape more than one part.
SHAPING = {
    "lidar.holes": "the screws of the lidar",
    "printer.screw_clearance_mm": "every screw hole",
    "slip_ring.friction_nm": f"whether there is a {COUNTERWEIGHT}",
    "servo.holes": "the screws of the servo's case",
}
SHOWN_CHARS = 60  # of a value in a message; a longer one is cut


def module_checks(scanner: Scanner, left_out: Iterable[LeftOut]) -> list[Finding]:
    """Return an error for each required module that does not fit; a module has the name of the part that it adds."""
    what = "the task requires it (modules.{0} = true), but it does not fit"
    return [
        Finding("module", "error", part.what, f"{part.what}: {what.format(part.what)}: {part.why}")
        for part in left_out
        if getattr(scanner.modules, part.what, False)
    ]


def unverified(product: Product, assembly: Assembly) -> Iterator[Finding]:
    """Yield a warning for each unverified value of a product that shapes a part."""
    provenance, shaping = product.provenance(), dict(SHAPING)
    for field in product.unverified():
        parts = [part.name for part in assembly.parts.values() if f"{product.kind}.{field}" in part.shaped_by]
        if parts:
            shaping[f"{product.kind}.{field}"] = " and ".join(parts)
    for part in reversed(assembly.parts.values()):  # the first part that describes a value wins
        shaping |= part.shapes
    for field in product.unverified():
        if f"{product.kind}.{field}" in shaping:
            value, source = _shown(getattr(product, field)), provenance[field].source
            message = f"{product.name}: {field}{value} is not verified ({source})"
            hint = f"{how_to_measure(field)}: it shapes {shaping[f'{product.kind}.{field}']}"
            yield Finding("unverified", "warning", product.name, message, hint=hint)


def _shown(value: object) -> str:
    if isinstance(value, tuple) and value and isinstance(value[0], Hole):
        return f" = {what_holds(value)}"
    text = str(list(value)) if isinstance(value, tuple) else str(value)
    return f" = {text}" if len(text) < SHOWN_CHARS else ""
