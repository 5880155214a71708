"""Laws that no effect of the catalogue states: a place, a driver and a power law.

    force on the head or disc   F = ε μ0 R^d m v,     m = (ω/ω_c)^p (l/l_c)^q (N/N_c)^r
    side force elsewhere        the same with M_y = z F_x, z = λ l or λ L ahead of J
    coefficient of the head     C × m^ε
    drag of the tails           ζ∥, ζ⊥ × m^ε
    stiffness of the tails      EI × m^ε

F is one of F_x, F_z, M_y, M_z about J, and v is one of v_x, v_z, ω_yr, ω_h, ω_t. d makes ε dimensionless. A term
that would tell left from right is multiplied by the sign of the motor where it is `rectified`; mirror symmetry
allows just one of the two. C is C_t, C_r or C_yr. A factor has one pattern of exponents, whose size is ε.

ω_c, l_c and N_c belong to the paper's control example. ω/ω_c is ω̄ (l/r0)⁻⁴ over its value there and l/l_c is l/R
over its value there, as for one material, fluid and head.

A law's name states it in full: "law_Fx_wh_speed-93_length425_tails0" has the exponents −0.093, 0.425 and 0, and
"law_Fx_wt_l-500_speed0_length1000_tails1000" acts half a tail's length behind J. So a file or a process that knows
only the name has the law. Exponents and levers are rounded to thousandths. They lie from −4 to 4. Laws of effects
that act on the tails are in `sim.model.scaled_effect`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from sim.arrays import Floats
from sim.io.errors import InputError
from sim.linear.complex_step import magnitude, sign
from sim.model.effect import Effect, Factors
from sim.model.presets import CONTROL

if TYPE_CHECKING:
    from sim.model.body import Body
    from sim.model.groups import Groups

WRENCHES = {"Fx": ("F_x", 1), "Fz": ("F_z", 1), "My": ("M_y", 2), "Mz": ("M_z", 2)}  # symbol, power of length
MOTIONS = {"vx": ("v_x", 0), "vz": ("v_z", 0), "wyr": ("ω_yr", 1), "wh": ("ω_h", 1), "wt": ("ω_t", 1)}
COEFFICIENTS = {"Ct": "C_t", "Cr": "C_r", "Cyr": "C_yr"}
TAILS = {"tail_drag": "drag of the tails", "tail_stiffness": "stiffness of the tails"}
_COUPLE = list(WRENCHES).index("My")
_TAIL_SYMBOLS = {"tail_drag": "ζ∥, ζ⊥", "tail_stiffness": "EI"}
STEEPEST = 4.0
LEVERS = {"l": "tail lengths l", "L": "head lengths L"}  # units of the place of a side force, ahead of J
_CONTROL_SPEED = CONTROL.omega_bar / CONTROL.l_over_r0**4
_CONTROL_TAILS = 2


@dataclass(frozen=True)
class Powers:
    """Exponents of motor speed, tail length and number of tails, to a thousandth.

    Example:
        >>> Powers(speed=-0.093, length=0.425).name
        'speed-93_length425_tails0'
    """

    PATTERN: ClassVar[str] = r"speed(-?\d{1,4})_length(-?\d{1,4})_tails(-?\d{1,4})"  # of `name`

    speed: float = 0.0
    length: float = 0.0
    tails: float = 0.0

    @classmethod
    def from_digits(cls, digits: Sequence[str]) -> Powers | None:
        """Read the three numbers of a name; None where one is too large."""
        exponents = [int(text) / 1000 for text in digits]
        return None if max(map(abs, exponents)) > STEEPEST else cls(*exponents)

    def __post_init__(self) -> None:
        for name, value in (("speed", self.speed), ("length", self.length), ("tails", self.tails)):
            if not abs(value) <= STEEPEST:
                raise InputError(f"exponent of {name} = {value:g}; it must lie from {-STEEPEST:g} to {STEEPEST:g}")
            object.__setattr__(self, name, round(value, 3) + 0.0)

    @property
    def name(self) -> str:
        """The exponents as part of a law's name."""
        pairs = (("speed", self.speed), ("length", self.length), ("tails", self.tails))
        return "_".join(f"{name}{round(1000 * value)}" for name, value in pairs)

    @property
    def words(self) -> str:
        """The factor as a formula, empty for a constant."""
        pairs = (("ω/ω_c", self.speed), ("l/l_c", self.length), ("N/N_c", self.tails))
        return "".join(f" ({symbol})^{value:g}" for symbol, value in pairs if value)

    def logarithm(self, groups: Groups) -> Floats:
        """Compute ln m of B robots, (B,)."""
        speed = magnitude(groups.omega_bar) / groups.l_over_r0**4 / _CONTROL_SPEED
        length = groups.l_over_R / CONTROL.l_over_R
        tails = self.tails * np.log(np.asarray(groups.N) / _CONTROL_TAILS)
        return np.asarray(self.speed * np.log(speed) + self.length * np.log(length) + tails)


_LAW = re.compile(
    rf"law_({'|'.join([*WRENCHES, *COEFFICIENTS, *TAILS])})(?:_({'|'.join(MOTIONS)}))?(_rectified)?"
    r"(?:_([lL])(-?\d{1,4}))?_" + Powers.PATTERN,
    re.ASCII,
)


@dataclass(frozen=True)
class ForceLaw(Effect):
    """ε μ0 R^d m times a velocity component, as a component of the wrench on head and disc about J."""

    wrench: str = ""  # of WRENCHES
    motion: str = ""  # of MOTIONS
    rectified: bool = False
    powers: Powers = Powers()
    lever: float = 0.0  # of a side force: how far ahead of J it acts
    lever_unit: str = ""  # of LEVERS; empty: at J

    def adds(self, size: Floats, groups: Groups, body: Body) -> Body:
        strength = size * np.exp(self.powers.logarithm(groups))
        if self.rectified:
            strength = strength * sign(groups.omega_bar)
        d = WRENCHES[self.wrench][1] + MOTIONS[self.motion][1]
        row, column = list(WRENCHES).index(self.wrench), list(MOTIONS).index(self.motion)
        force = -strength / groups.l_over_R**d
        if not self.lever_unit:
            return body.with_resistance({(row, column): force})
        ahead = self.lever * (body.head_length if self.lever_unit == "L" else 1.0)
        return body.with_resistance({(row, column): force, (_COUPLE, column): ahead * force})


@dataclass(frozen=True)
class FactorLaw(Effect):
    """A coefficient of the head, or the drag or the stiffness of the tails, times m^ε."""

    place: str = ""  # of COEFFICIENTS or TAILS
    powers: Powers = Powers()

    def adds(self, size: Floats, groups: Groups, body: Body) -> Body:
        more = np.exp(size * self.powers.logarithm(groups)) - 1
        R, L = body.head_radius, body.head_length
        lever = L / 2
        if self.place == "Cr":
            return body.with_resistance({(3, 3): more * 8 * math.pi * groups.C_r * R**3})
        if self.place == "Cyr":
            side = more * groups.C_yr * R * L
            return body.with_resistance({(0, 3): side, (2, 3): side * lever})
        if self.place == "Ct":
            drag = more * 6 * math.pi * groups.C_t * R
            coupled = drag * lever
            return body.with_resistance(
                {(0, 0): drag, (1, 1): drag, (0, 2): coupled, (2, 0): coupled, (2, 2): coupled * lever}
            )
        return body

    def scales(self, size: Floats, groups: Groups) -> Factors:
        """Return what a law of the tails multiplies; stiffer tails move as in a fluid of viscosity μ0 m^(−ε)."""
        if self.place in COEFFICIENTS:
            return Factors()
        factor = np.exp(size * self.powers.logarithm(groups))
        return Factors(tail_drag=factor) if self.place == "tail_drag" else Factors(viscosity=1 / factor)


def is_mirrored(wrench: str, motion: str) -> bool:
    """Tell whether both or neither of a force and its driver change sign with the motor's direction."""
    return (wrench == "Fz") == (motion == "vz")


def force_law(
    wrench: str,
    motion: str,
    powers: Powers,
    *,
    rectified: bool | None = None,
    lever: float = 0.0,
    lever_unit: str = "",
) -> ForceLaw:
    """Make the law of a force on head and disc.

    Args:
        wrench: component of the force, of WRENCHES.
        motion: component of the velocity that drives it, of MOTIONS.
        powers: exponents of its factor.
        rectified: whether the sign of the motor multiplies it; None: as mirror symmetry wants it.
        lever: of a side force, how far ahead of J it acts, to a thousandth.
        lever_unit: of LEVERS; empty: it acts at J.

    Raises:
        InputError: the lever is too long, or the force has none.
    """
    if lever_unit and (lever_unit not in LEVERS or wrench != "Fx"):
        raise InputError(f"a force {wrench} has no lever in {lever_unit!r}; only Fx has one, in l or L")
    if not abs(lever) <= STEEPEST:
        raise InputError(f"lever = {lever:g}; it must lie from {-STEEPEST:g} to {STEEPEST:g}")
    lever = round(lever, 3) + 0.0
    mirrored = is_mirrored(wrench, motion)
    turned = not mirrored if rectified is None else rectified
    symbol, d_force = WRENCHES[wrench]
    driver, d_motion = MOTIONS[motion]
    d = d_force + d_motion
    unit = f"μ0 R^{d}" if d > 1 else "μ0 R"
    at = f"_{lever_unit}{round(1000 * lever)}" if lever_unit else ""
    where = f" at z = {lever:g} {lever_unit}" if lever_unit else ""
    return ForceLaw(
        name=f"law_{wrench}_{motion}{'_rectified' if turned else ''}{at}_{powers.name}",
        title=f"{symbol} on the {'tails' if lever_unit == 'l' else 'head'} from {driver}",
        equation=f"{symbol} = ε {unit}{powers.words} {driver}{' sgn ω' if turned else ''}{where}",
        source="a power law, from measured runs",
        unit=unit,
        bounds=(-5000.0, 5000.0),
        typical=0.5,
        symmetry="even" if turned != mirrored else "odd",
        similar=not powers.speed,
        wrench=wrench,
        motion=motion,
        rectified=turned,
        powers=powers,
        lever=lever,
        lever_unit=lever_unit,
    )


def factor_law(place: str, powers: Powers) -> Effect:
    """Make the law of a coefficient of the head, of COEFFICIENTS, or of the drag or stiffness of the tails.

    Args:
        place: of COEFFICIENTS or TAILS.
        powers: exponents of its factor.
    """
    symbol = COEFFICIENTS.get(place) or _TAIL_SYMBOLS[place]
    return FactorLaw(
        name=f"law_{place}_{powers.name}",
        title=f"{COEFFICIENTS.get(place) or TAILS[place]} as a power law",
        equation=f"{symbol} × [{powers.words.strip()}]^ε",
        source="a power law, from measured runs",
        bounds=(-4.0, 4.0),
        typical=0.2,
        similar=not powers.speed,
        place=place,
        powers=powers,
    )


def law_from_name(name: str) -> Effect | None:
    """Return the law that a name states in full; None where it states none, or not as a law's own name does."""
    match = _LAW.fullmatch(name)
    if not match:
        return None
    place, motion, rectified, lever_unit, lever, *digits = match.groups()
    powers = Powers.from_digits(digits)
    if powers is None or (place not in WRENCHES) == bool(motion) or (rectified and not motion):
        return None
    try:
        if motion:
            ahead, unit = (int(lever) / 1000, lever_unit) if lever_unit else (0.0, "")
            turned = bool(rectified)
            law: Effect = force_law(place, motion, powers, rectified=turned, lever=ahead, lever_unit=unit)
        else:
            law = factor_law(place, powers)
    except InputError:
        return None
    return law if law.name == name else None
