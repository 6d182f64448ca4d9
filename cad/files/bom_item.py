"""One row of `bom.csv`."""

from dataclasses import dataclass, fields

JOINTS = "joints of the layout"
STEPS, WIRING_TEXT = "assembly.md", "wiring.md"


@dataclass(frozen=True, slots=True)
class BomItem:
    """One row; all fields except `estimate` are columns. Empty texts and None are unknown."""

    kind: str  # printed, turned, sawn, material, bought, screw, nut, washer, insert, wiring, consumable, tool or total
    part: str  # name, or type of product
    number: str = ""  # drawing number of a made part, designation of a standard part
    quantity: int | None = 1  # pieces
    supplier: str = ""  # maker
    supplier_number: str = ""  # order number
    unit_usd: float | None = None  # price of one
    total_usd: float | None = None  # price of all
    low_usd: float | None = None  # least price of all: from the price, or an estimate
    high_usd: float | None = None  # largest price of all
    priced: str = ""  # year of the price
    mass_g: float | None = None  # of one
    source: str = ""  # of the price, or of the row
    verified: str = ""  # whether the price is verified; empty if there is none
    note: str = ""  # for the buyer
    estimate: str = ""  # name in `prices.EACH_USD`; empty if there is none


COLUMNS = [field.name for field in fields(BomItem)][:-1]
