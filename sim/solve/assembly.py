"""From robots to the numbers of their balance (`Body`): the paper's model, and the effects of the robots.

Everything here is analytic. So the complex step (`sim.linear.complex_step`) gives the derivatives of a robot's
numbers in any input or effect size.
Source of the base model: Du, Miller, Jawed (arXiv 2103.05712).
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from common.arrays import Flags, Floats
from sim.effects import catalogue, effect_named
from sim.mechanics.drag import tail_coefficients
from sim.model.body import PLACES, SHAPES, SINGLE, Body, head_resistance
from sim.model.groups import Groups
from sim.model.laws import LOCAL_DRAG

# Numbers of the non-local effects, by their names; plain numbers in compiled loops.
_NONLOCAL = {e.term: e for e in (*catalogue().values(), *LOCAL_DRAG.values()) if e.reach == "nonlocal"}
Nonlocal = namedtuple("Nonlocal", list(_NONLOCAL))  # type: ignore[misc]
CONTACT = Nonlocal._fields.index("tail_contact") - len(Nonlocal._fields)  # its place in a robot's numbers


def assemble(groups: Groups) -> Body:
    """Assemble the numbers of B robots as arrays, effects included; single ones are (B,).

    Raises:
        InputError: an unknown effect.
    """
    R = 1 / groups.l_over_R
    L = groups.L_over_R * R
    none = np.zeros(R.shape)
    zeta_parallel, zeta_perp = tail_coefficients(groups.l_over_r0)
    body = Body(
        omega=groups.omega_bar,
        offset=groups.a_over_R * R,
        head_radius=R,
        head_length=L,
        tail_radius=1 / groups.l_over_r0,
        axial_stiffness=4 * groups.l_over_r0**2,
        viscosity=np.ones(R.shape),
        zeta_parallel=zeta_parallel,
        zeta_perp=zeta_perp,
        resistance=np.array(head_resistance(groups.C_t, groups.C_r, groups.C_yr, R, L)),
        droop=none,
        tail_load=np.zeros((3, *R.shape)),
        nonlocal_terms=Nonlocal(*[none] * len(Nonlocal._fields)),
    )
    return with_effects(body, groups)


def with_effects(body: Body, groups: Groups) -> Body:
    """Add the effects of `groups` to the body: first all terms are added, then all factors multiply.

    Raises:
        InputError: an unknown effect.
    """
    terms = body.nonlocal_terms._asdict()
    viscosity: Any = np.ones(len(groups))
    drag, tail_drag = np.ones(len(groups)), np.ones(len(groups))
    for name, size in groups.effects.items():
        effect = effect_named(name)
        if effect.reach == "nonlocal":
            terms[effect.term] = terms[effect.term] + effect.number(size, groups)
        body = effect.adds(size, groups, body)
        factors = effect.scales(size, groups)
        viscosity, drag = viscosity * factors.viscosity, drag * factors.drag
        tail_drag = tail_drag * factors.tail_drag
    all_drag = viscosity * drag
    terms = {name: value * all_drag if _NONLOCAL[name].is_drag else value for name, value in terms.items()}
    return body._replace(
        viscosity=viscosity,
        zeta_parallel=body.zeta_parallel * (all_drag * tail_drag),
        zeta_perp=body.zeta_perp * (all_drag * tail_drag),
        resistance=body.resistance * all_drag,
        nonlocal_terms=Nonlocal(**terms),
    )


def numbers(groups: Groups) -> Floats:
    """Return the numbers of B robots, (B, K), in the order of `Body`."""
    body = assemble(groups)
    parts = [getattr(body, name) for name in body._fields[:-1]] + list(body.nonlocal_terms)
    return np.ascontiguousarray(np.concatenate([part.reshape(-1, len(groups)) for part in parts]).T)


def are_local(rows: Floats) -> Flags:
    """Tell which robots have no effect that reaches further than one node, from their `numbers` (B, K); (B,)."""
    return np.asarray(~(rows[:, PLACES.nonlocal_terms] != 0).any(1))


def without_further(rows: Floats) -> Floats:
    """Return the `numbers` (B, K) of the same robots with no other non-local effect than contact."""
    plain = rows.copy()
    plain[:, PLACES.nonlocal_terms] = 0.0
    plain[:, CONTACT] = rows[:, CONTACT]
    return plain


def batch(rows: Floats) -> Body:
    """Return B robots as one `Body` of arrays that end with (B,), from their `numbers` (B, K)."""
    columns = np.ascontiguousarray(rows.T)
    resistance = columns[PLACES.resistance].reshape(*SHAPES.resistance, len(rows))
    terms = Nonlocal(*columns[PLACES.nonlocal_terms])
    return Body(*columns[:SINGLE], resistance, columns[PLACES.tail_load], terms)  # type: ignore[call-arg]


def row(body: Body) -> Floats:
    """Return the `numbers` of one robot, (1, K)."""
    return np.concatenate([np.ravel(part) for part in body])[None]


def bodies(groups: Groups) -> list[Body]:
    """Return the robots one by one, with plain numbers."""
    body = batch(numbers(groups))
    terms, parts = np.array(body.nonlocal_terms), [np.moveaxis(part, -1, 0) for part in body[:-1]]
    return [
        Body._make([*(part[i] for part in parts), Nonlocal(*terms[:, i])])._replace(
            resistance=body.resistance[..., i].copy(), tail_load=tuple(body.tail_load[:, i])
        )
        for i in range(len(groups))
    ]
