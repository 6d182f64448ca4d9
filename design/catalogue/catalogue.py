"""The products for scanners by name: the shipped ones, and those of a user's own files.

One TOML file per product. Every value is written with its source and whether it was verified:

    mass_g = { value = 370.0, source = "Hokuyo UTM-30LX data sheet", verified = true }

so that a build can list its unverified dimensions. A user's own catalogue file adds products or replaces shipped ones
of the same name.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from scanwright.design.catalogue.holes import with_holes
from scanwright.design.catalogue.lidar import Lidar
from scanwright.design.catalogue.product_base import Product, Provenance
from scanwright.design.catalogue.products import Bearing, Belt, Multibeam, Printer
from scanwright.design.catalogue.servo import Servo
from scanwright.design.catalogue.slip_ring import SlipRing
from scanwright.design.errors import TaskError, suggest
from scanwright.design.files.faults import Fault, faults_in, format_faults
from scanwright.design.files.text_files import read_toml

SHIPPED = Path(__file__).parent
LIDAR_GROUP, SERVO_GROUP = "scanwright.lidars", "scanwright.servos"
"""Entry points of installed packages that add a family of devices; their products are in that module's folder."""

P = TypeVar("P", bound=Product)
KINDS: dict[str, type[Product]] = {
    "lidar": Lidar,
    "servo": Servo,
    "slip_ring": SlipRing,
    "bearing": Bearing,
    "belt": Belt,
    "printer": Printer,
    "multibeam": Multibeam,
}


@dataclass(frozen=True, slots=True)
class Catalogue:
    """All products by name."""

    products: dict[str, Product]

    def get(self, name: str, kind: type[P]) -> P:
        """Return the product of a name and kind.

        Raises:
            TaskError: no such product; the message suggests the nearest name.
        """
        product = self.products.get(name)
        if not isinstance(product, kind):
            known = [other.name for other in self.products.values() if isinstance(other, kind)]
            title = next((word for word, record in KINDS.items() if record is kind), "product").replace("_", " ")
            raise TaskError(f"'{name}' is no {title} of the catalogue{suggest(name, known)}")
        return product

    def bearings(self) -> tuple[Bearing, ...]:
        """Return all bearings, smallest bore first."""
        matching = [product for product in self.products.values() if isinstance(product, Bearing)]
        return tuple(sorted(matching, key=lambda bearing: (bearing.bore_mm, bearing.outer_mm, bearing.name)))

    def belts(self) -> tuple[Belt, ...]:
        """Return all belts, the narrowest first."""
        matching = [product for product in self.products.values() if isinstance(product, Belt)]
        return tuple(sorted(matching, key=lambda belt: (belt.width_mm, belt.pitch_mm, belt.name)))

    def named(self, name: str) -> Product:
        """Return the product of a name, of any kind.

        Raises:
            TaskError: no such product; the message suggests the nearest name.
        """
        if name not in self.products:
            raise TaskError(f"'{name}' is not in the catalogue{suggest(name, self.products)}")
        return self.products[name]

    def __iter__(self) -> Iterator[Product]:
        """Return the products in the order of their kinds, then names."""
        order = list(KINDS.values())
        return iter(sorted(self.products.values(), key=lambda p: (order.index(type(p)), p.name)))


def load_catalogue(*extra: Path) -> Catalogue:
    """Return the shipped products and those of the user's own files, which replace products of the same name.

    Raises:
        TaskError: a file is missing, malformed, or a product lacks a value.
    """
    products = dict(_shipped())
    messages = []
    for path in extra:
        try:
            product = load_product(path)
        except TaskError as error:
            messages.append(str(error))
        else:
            products[product.name] = product
    if messages:
        raise TaskError("\n".join(messages))
    return Catalogue(products)


def load_product(path: Path) -> Product:
    """Read one product file.

    Raises:
        TaskError: as for `load_catalogue`.
    """
    table = read_toml(path, "the catalogue file")
    kind = table.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise TaskError(f"{path}: kind = {kind!r}: not a kind of product{suggest(str(kind), KINDS)}")
    values: dict[str, Any] = {}
    provenance: dict[str, Provenance] = {}
    faults: list[Fault] = []
    for key, entry in with_holes(table).items():
        if key in ("kind", "name", "maker"):
            values[key] = entry
        elif isinstance(entry, dict) and entry.keys() == {"value", "source", "verified"}:
            values[key] = entry["value"]
            if isinstance(entry["source"], str) and isinstance(entry["verified"], bool):
                provenance[key] = Provenance(source=entry["source"], verified=entry["verified"])
            else:
                faults.append(Fault((key,), ": source is a text, verified is true or false"))
        else:
            faults.append(Fault((key,), ': write it as { value = ..., source = "...", verified = true }'))
    badly_written = {fault.path for fault in faults}
    try:
        product = KINDS[kind].model_validate(values)
    except ValidationError as error:
        faults += [fault for fault in faults_in(error, KINDS[kind]) if fault.path not in badly_written]
    if faults:
        raise TaskError(format_faults(faults, path))
    product._provenance.update(provenance)
    return product


def file_of(name: str) -> Path | None:
    """Return the file of a product of the shipped catalogue or of an installed package, to copy and change."""
    return next((path for path in reversed(_files()) if read_toml(path, "the catalogue file")["name"] == name), None)


@cache
def _shipped() -> dict[str, Product]:
    return {product.name: product for product in map(load_product, _files())}


def _files() -> list[Path]:
    """Return all product files; the last one of a name takes precedence."""
    return [path for folder in (SHIPPED, *_installed()) for path in sorted(folder.glob("*.toml"))]


def _installed() -> list[Path]:
    """Return the folders of the modules of installed packages in these groups, without importing them."""
    modules = {entry.module for group in (LIDAR_GROUP, SERVO_GROUP) for entry in entry_points(group=group)}
    specs = [find_spec(module) for module in sorted(modules)]
    return [Path(spec.origin).parent for spec in specs if spec is not None and spec.origin is not None]
