"""The numbers of a robot as its file has them: table, key, unit, and field of `Robot`."""

from __future__ import annotations

from typing import NamedTuple

from common.units import UNITS, from_si, split


class Entry(NamedTuple):
    """A number of a robot: its table and key, its field of `Robot`, and the unit in which it is written."""

    table: str
    quantity: str
    field: str
    unit: str = ""  # none: the key has no suffix
    comment: str = ""
    optional: bool = False

    @property
    def key(self) -> str:
        """The key as it is written."""
        return self.with_unit(self.unit)

    def with_unit(self, unit: str) -> str:
        """Return the key for another unit."""
        return f"{self.quantity}_{unit}" if unit else self.quantity

    def written(self, number: float) -> float:
        """Convert a number from SI units to the unit in which it is written."""
        return float(from_si(number, self.unit)) if self.unit else number

    def fits(self, table: str, key: str) -> bool:
        """Say whether a key holds this number, in any unit of its kind."""
        quantity, unit = split(key)
        if not self.unit:
            return (table, key) == (self.table, self.quantity)
        kind = unit.kind if unit else None
        return (table, quantity, kind) == (self.table, self.quantity, UNITS[self.unit].kind)


ENTRIES = (
    Entry("tails", "count", "tails"),
    Entry("tails", "length", "tail_length", "cm"),
    Entry("tails", "radius", "tail_radius", "mm", "of a tail's section"),
    Entry("tails", "youngs_modulus", "youngs_modulus", "MPa"),
    Entry("tails", "disc_offset", "disc_offset", "mm", "from the axis to a tail's clamp", optional=True),
    Entry("head", "radius", "head_radius", "mm"),
    Entry("head", "length", "head_length", "mm"),
    Entry("fluid", "viscosity", "viscosity", "Pa_s"),
    Entry("motor", "speed", "motor_speed", "rpm", "tails relative to head; the direction is the control"),
    Entry("drag", "C_t", "C_t", comment="force against motion: C_t 6π μ R v"),
    Entry("drag", "C_r", "C_r", comment="couple against spin: C_r 8π μ R³ ω"),
    Entry("drag", "C_yr", "C_yr", comment="side force of the spinning head, from the surface: C_yr μ R L ω"),
)
