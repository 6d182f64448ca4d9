"""The parts list of `bom.csv` in groups, in the order in which a person needs them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from scanwright.cad.files.prices import ESTIMATED
from scanwright.report.build_files import read_table

Row = dict[str, str]
GROUPS = {
    "Devices": ("bought",),
    "Parts to print": ("printed",),
    "Parts to have machined": ("turned", "sawn"),
    "Screws, nuts, washers, inserts": ("screw", "nut", "washer", "insert"),
    "Wiring": ("wiring",),
    "Consumables": ("material", "consumable"),
    "Tools": ("tool",),
}
OTHERS = "Others"


@dataclass(frozen=True, slots=True)
class Group:
    """Rows of one kind."""

    title: str
    rows: tuple[Row, ...]

    @property
    def usd(self) -> str:
        """Return the range of the price."""
        return usd_range(self.rows)


@dataclass(frozen=True, slots=True)
class PartsList:
    """All rows but the total, in groups; `total` is None if the file has none."""

    groups: tuple[Group, ...]
    total: Row | None

    @property
    def usd(self) -> str:
        """Return the range of the total, as the file states it."""
        return "unknown" if self.total is None else usd_range([self.total])

    @property
    def screws(self) -> int:
        """Return the number of screws."""
        return sum(int(row["quantity"] or 0) for row in self._rows("screw"))

    @property
    def bought(self) -> dict[str, str]:
        """Return the kind of each device by its number."""
        return {row["number"]: row["part"] for row in self._rows("bought")}

    @property
    def printing(self) -> str:
        """Return the time to print all parts; empty if the file does not state it."""
        return next((row["note"].partition(";")[0] for row in self._rows("material") if " h" in row["note"]), "")

    @property
    def to_make(self) -> str:
        """Return how many parts to print and to have machined, and the time to print."""
        return f"{self.made_words}; {self.printing}" if self.printing else self.made_words

    @property
    def made_words(self) -> str:
        """Return how many parts to print and to have machined; none is counted twice."""
        printed, machined = (
            sum(int(row["quantity"] or 1) for row in self._rows(*kinds)) for kinds in (("printed",), ("turned", "sawn"))
        )
        words = f"{printed} part{'' if printed == 1 else 's'} to print"
        if not machined:
            return f"{words}, none to have machined"
        return f"{words} and {machined} other{'' if machined == 1 else 's'} to have machined"

    def group(self, kind: str) -> Group | None:
        """Return the group of a kind of row; None if it has no rows."""
        return next((group for group in self.groups if kind in GROUPS.get(group.title, ())), None)

    def _rows(self, *kinds: str) -> list[Row]:
        return [row for group in self.groups for row in group.rows if row["kind"] in kinds]


def read_parts(path: Path) -> PartsList:
    """Return the parts list of a `bom.csv`."""
    rows = read_table(path)
    title_of = {kind: title for title, kinds in GROUPS.items() for kind in kinds}
    grouped: dict[str, list[Row]] = {title: [] for title in (*GROUPS, OTHERS)}
    for row in rows:
        row["note"] = row["note"].replace(ESTIMATED, "estimate")  # the page explains it once
        if row["kind"] != "total":
            grouped[title_of.get(row["kind"], OTHERS)].append(row)
    groups = tuple(Group(title, tuple(members)) for title, members in grouped.items() if members)
    return PartsList(groups, next((row for row in rows if row["kind"] == "total"), None))


def price(row: Row) -> str:
    """Return the range of one row's price as numbers; empty if there is none."""
    ends = [float(row[column]) for column in ("low_usd", "high_usd") if row[column]]
    return " to ".join(dict.fromkeys(f"{end:,.0f}" if end >= 10 else f"{end:.2g}" for end in ends))


def usd_range(rows: Sequence[Row]) -> str:
    """Return the range of the price of rows in words; one number if both ends round to it."""
    low, high = (sum(float(row[end] or 0.0) for row in rows) for end in ("low_usd", "high_usd"))
    ends = dict.fromkeys(f"{end:,.0f}" for end in (low, high))
    return f"{' to '.join(ends)} USD"
