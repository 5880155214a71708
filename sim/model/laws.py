"""Laws that no effect of the catalogue states: a place, a driver and a power law.

    force on the head or disc   F = ε μ0 R^d m v,     m = (ω/ω_c)^p (l/l_c)^q (N/N_c)^r
    side force elsewhere        the same with M_y = z F_x, z = λ l or λ L ahead of J
    coefficient of the head     C × m^ε
    drag of the tails           ζ∥, ζ⊥ × m^ε
    stiffness of the tails      EI × m^ε
    effect on the tails         ε m in place of its size

F is one of F_x, F_z, M_y, M_z about J, and v is one of v_x, v_z, ω_yr, ω_h, ω_t. d makes ε dimensionless. A term
that would tell left from right is multiplied by the sign of the motor; of the two, with and without the sign,
mirror symmetry allows one, and the other is `odd`. C is C_t, C_r or C_yr. A factor has one pattern of exponents,
whose size is ε. Effects on the tails are those of SCALED, and drag that differs along the tails:

    tail_drag_by_speed   ζ∥, ζ⊥ × (λ |v|/r0)^ε       a power of the local speed, as a power-law fluid has it
    tail_drag_along      ζ∥, ζ⊥ × e^(ε (2 s/l − 1))   larger at the free end for ε > 0

s is the distance from the clamp. λ |v|/r0 is 1 at the clamps of the paper's control example, as in
`sim.effects.shear_thinning`. These two are no members of the catalogue: a power law has no fluid of its own, and a
gradient no cause.

ω_c, l_c and N_c belong to the paper's control example. ω/ω_c is ω̄ (l/r0)⁻⁴ over its value there and l/l_c is l/R
over its value there, as for one material, fluid and head.

`make_law` makes a law of its place, powers and lever. In a file its name states it in full, as a key of [effects]
or a column: "law_Fx_wh_speed-93_length425_tails0" has the exponents −0.093, 0.425 and 0, and
"law_Fx_wt_l-500_speed0_length1000_tails1000" acts half a tail's length behind J. Exponents and levers are rounded
to thousandths. They lie from −4 to 4.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from common.arrays import Floats
from common.errors import InputError
from sim.linear.complex_step import magnitude, sign
from sim.model.body import Body, head_resistance
from sim.model.effect import Effect, Factors
from sim.model.groups import Groups
from sim.model.presets import CONTROL

WRENCHES = {"Fx": ("F_x", 1), "Fz": ("F_z", 1), "My": ("M_y", 2), "Mz": ("M_z", 2)}  # symbol, power of length
MOTIONS = {"vx": ("v_x", 0), "vz": ("v_z", 0), "wyr": ("ω_yr", 1), "wh": ("ω_h", 1), "wt": ("ω_t", 1)}
COEFFICIENTS = {"Ct": "C_t", "Cr": "C_r", "Cyr": "C_yr"}
TAILS = {"tail_drag": "drag of the tails", "tail_stiffness": "stiffness of the tails"}
SCALED = ("tail_spin_drag", "natural_splay", "tail_sag", "natural_curvature")  # effects of the catalogue
LEVERS = {"l": "tail lengths l", "L": "head lengths L"}  # units of the place of a side force, ahead of J
STEEPEST = 4.0
_SOURCE = "a power law, from measured runs"
_SYMBOLS = {**COEFFICIENTS, "tail_drag": "ζ∥, ζ⊥", "tail_stiffness": "EI"}
_WIDER = 20.0  # bounds of a law over those of the effect on the tails
_CONTROL_SPEED = CONTROL.omega_bar / CONTROL.l_over_r0**4
_CONTROL_TAILS = 2
_NAME = re.compile(r"law_([A-Za-z_]+?)(-?\d{1,4})?_speed(-?\d{1,4})_length(-?\d{1,4})_tails(-?\d{1,4})", re.ASCII)


def _thousandths(what: str, value: float) -> float:
    """Round an exponent or a lever.

    Raises:
        InputError: it is beyond STEEPEST.
    """
    if not abs(value) <= STEEPEST:
        raise InputError(f"{what} = {value:g}; it must lie from {-STEEPEST:g} to {STEEPEST:g}")
    return round(value, 3) + 0.0


@dataclass(frozen=True)
class Powers:
    """Exponents of motor speed, tail length and number of tails, to a thousandth.

    Example:
        >>> Powers(speed=-0.093, length=0.425).words
        ' (ω/ω_c)^-0.093 (l/l_c)^0.425'
    """

    speed: float = 0.0
    length: float = 0.0
    tails: float = 0.0

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            object.__setattr__(self, name, _thousandths(f"exponent of {name}", value))

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

    def factor(self, groups: Groups, power: Any = 1.0) -> Floats:
        """Compute m of B robots to a power, (B,)."""
        return np.asarray(np.exp(power * self.logarithm(groups)))


class Load(NamedTuple):
    """A component of the wrench on head and disc about J that is driven by a component of the velocity."""

    wrench: str  # of WRENCHES
    motion: str  # of MOTIONS
    odd: bool = False  # in the direction of the motor
    lever_unit: str = ""  # of LEVERS, of a side force that acts away from J

    @property
    def rectified(self) -> bool:
        """Whether the sign of the motor multiplies it: force and driver change sign with it together, or not."""
        return ((self.wrench == "Fz") == (self.motion == "vz")) == self.odd

    @property
    def place(self) -> str:
        """Name of the place: "Fx_wh", "Fx_vz_rectified", "Fx_wt_l"."""
        return "_".join(filter(None, (*self[:2], "rectified" * self.rectified, self.lever_unit)))


LOADS = {
    load.place: load
    for load in map(Load._make, product(WRENCHES, MOTIONS, (False, True), ("", *LEVERS)))
    if load.wrench == "Fx" or not load.lever_unit
}


@dataclass(frozen=True, kw_only=True)
class PowerLawEffect(Effect):
    """An effect at one place, times a power of motor speed, tail length and number of tails; see `make_law`."""

    place: str
    powers: Powers
    lever: float = 0.0
    effect: Effect | None = None  # on the tails, whose size it multiplies

    @property
    def term(self) -> str:
        return self.effect.term if self.effect else self.name


def _add_force(load: Load, powers: Powers, lever: float, size: Floats, groups: Groups, body: Body) -> Body:
    """Add ε μ0 R^d m times a velocity component, as a component of the wrench on head and disc about J."""
    strength = size * powers.factor(groups)
    if load.rectified:
        strength = strength * sign(groups.omega_bar)
    d = WRENCHES[load.wrench][1] + MOTIONS[load.motion][1]
    row, column = list(WRENCHES).index(load.wrench), list(MOTIONS).index(load.motion)
    force = -strength / groups.l_over_R**d
    if not load.lever_unit:
        return body.with_resistance({(row, column): force})
    ahead = lever * (body.head_length if load.lever_unit == "L" else 1.0)
    couple = list(WRENCHES).index("My")
    return body.with_resistance({(row, column): force, (couple, column): ahead * force})


def _scale_coefficient(place: str, powers: Powers, size: Floats, groups: Groups, body: Body) -> Body:
    """Multiply a coefficient of the head by m^ε."""
    more = powers.factor(groups, size) - 1
    C_t, C_r, C_yr = (more * getattr(groups, C) * (at == place) for at, C in COEFFICIENTS.items())
    return body.plus(resistance=np.array(head_resistance(C_t, C_r, C_yr, body.head_radius, body.head_length)))


def _scale_tails(place: str, powers: Powers, size: Floats, groups: Groups) -> Factors:
    """Multiply drag or stiffness of the tails by m^ε; stiffer ones move as in a fluid of viscosity μ0 m^(−ε)."""
    factor = powers.factor(groups, size)
    return Factors(tail_drag=factor) if place == "tail_drag" else Factors(viscosity=1 / factor)


def _scale_effect(way: str, effect: Effect, powers: Powers, size: Floats, groups: Groups, *body: Body) -> Any:
    """Let an effect act with m times its size."""
    return getattr(effect, way)(size * powers.factor(groups), groups, *body)


LOCAL_DRAG = {
    name: Effect(name, title, equation, _SOURCE, (-0.15, 0.15), 0.1, similar=False, reach="nonlocal")
    for name, title, equation in (
        ("tail_drag_by_speed", "drag of the tails by their local speed", "ζ∥, ζ⊥ × (λ |v|/r0)^ε"),
        ("tail_drag_along", "drag that differs along the tails", "ζ∥, ζ⊥ × e^(ε (2 s/l − 1))"),
    )
}


def make_law(place: str | Effect, powers: Powers = Powers(), *, lever: float = 0.0) -> PowerLawEffect:
    """Make a law.

    Args:
        place: of LOADS, COEFFICIENTS, TAILS or LOCAL_DRAG, or an effect of SCALED.
        powers: exponents of its factor.
        lever: of a side force that acts away from J, how far ahead of it, to a thousandth.

    Raises:
        InputError: there is no such place, the lever is too long, or the place has none.

    Example:
        >>> make_law("Fx_wt_l", Powers(tails=1), lever=-0.5).equation
        'F_x = ε μ0 R^2 (N/N_c)^1 ω_t at z = -0.5 l'
    """
    effect = place if isinstance(place, Effect) else LOCAL_DRAG.get(place)
    place = effect.name if effect else str(place)
    load = LOADS.get(place)
    unit = load.lever_unit if load else ""
    if lever and not unit:
        raise InputError(f"the place {place!r} has no lever; a side force Fx in l or L has one")
    lever = _thousandths("lever", lever)
    at = f"{round(1000 * lever)}" if unit else ""
    exponents = "_".join(f"{name}{round(1000 * value)}" for name, value in vars(powers).items())
    name = f"law_{place}{at}_{exponents}"
    stated: dict[str, Any] = {"name": name, "source": _SOURCE, "place": place, "powers": powers, "lever": lever}
    formula, similar = powers.words.strip(), not powers.speed
    # A load that the model lacks, with the power of R that makes its size ε a number.
    if load:
        (symbol, d_force), (driver, d_motion) = WRENCHES[load.wrench], MOTIONS[load.motion]
        d = d_force + d_motion
        scale = f"μ0 R^{d}" if d > 1 else "μ0 R"
        where = (" sgn ω" if load.rectified else "") + (f" at z = {lever:g} {unit}" if unit else "")
        return PowerLawEffect(
            **stated,
            title=f"{symbol} on the {'tails' if unit == 'l' else 'head'} from {driver}",
            equation=f"{symbol} = ε {scale}{powers.words} {driver}{where}",
            unit=scale,
            bounds=(-5000.0, 5000.0),
            typical=0.5,
            symmetry="odd" if load.odd else "even",
            similar=similar,
            adds=partial(_add_force, load, powers, lever),
        )
    # A coefficient, or a drag of the tails, that the model has: the size is an exponent, and 0 changes nothing.
    if place in _SYMBOLS:
        if place in COEFFICIENTS:
            stated["adds"] = partial(_scale_coefficient, place, powers)
        else:
            stated["scales"] = partial(_scale_tails, place, powers)
        return PowerLawEffect(
            **stated,
            title=f"{COEFFICIENTS.get(place) or TAILS[place]} as a power law",
            equation=f"{_SYMBOLS[place]} × [{formula}]^ε",
            bounds=(-STEEPEST, STEEPEST),
            typical=0.2,
            similar=similar,
        )
    if effect is None:
        raise InputError(f"no place {place!r} of a law; such are {', '.join([*_SYMBOLS, *LOADS][:8])}")
    # An effect of the catalogue whose size follows the power law; what it reaches and dissipates is its own.
    stated |= {way: partial(_scale_effect, way, effect, powers) for way in ("adds", "scales", "number")}
    return PowerLawEffect(
        **stated,
        title=f"{effect.title}, as a power law",
        equation=f"{effect.equation}, ε times {formula}" if formula else effect.equation,
        unit=effect.unit,
        bounds=(_WIDER * effect.bounds[0], _WIDER * effect.bounds[1]),
        typical=effect.typical,
        symmetry=effect.symmetry,
        dissipative=effect.dissipative,
        similar=effect.similar and similar,
        reach=effect.reach,
        is_drag=effect.is_drag,
        effect=effect,
    )


def read_law(name: str, effects: Mapping[str, Effect]) -> PowerLawEffect | None:
    """Read the name that a file has for a law; None if it is none, or not as a law's own name is written.

    Args:
        effects: by name, those of SCALED among them.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        return None
    place, lever, *exponents = match.groups()
    try:
        at = effects[place] if place in SCALED else place
        read = make_law(at, Powers(*(int(digits) / 1000 for digits in exponents)), lever=int(lever or 0) / 1000)
    except InputError:
        return None
    return read if read.name == name else None
