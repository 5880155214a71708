"""Material frames, flows and friction against solutions that do not share their code."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.integrate import quad_vec, solve_bvp

from sim import direct, flow, orbit
from sim.effects import catalogue
from sim.errors import InputError
from sim.framed_rod import FramedRod, Frames
from sim.frames import add_frames
from sim.resolution import Resolution
from sim.robot import PRESETS, Groups
from sim.sensitivity import sensitivities
from sim.settling import settle
from sim.steady import orbits
from sim.stepper import at_rest
from sim.tail import body_of, measure, motion_at, new_geometry
from tests.sim.robots import control, extrapolated_loads, held_loads, single_filament

ROBOT = PRESETS["paper-control"]
SLENDERNESS, OFFSET = ROBOT.tail_length / ROBOT.tail_radius, 0.016 / 0.11
OF_BEYOND = (
    "tail_spin_drag", "natural_curvature", "natural_splay", "rate_dependent_modulus",
    "tail_interaction", "head_flow", "free_surface", "contact_line",
)  # fmt: skip


def kirchhoff_loads(
    omega_bar: float, spin_drag: float, across: float, out: float, natural_twist: float
) -> np.ndarray:
    """Wrench of one filament on its held disc: Kirchhoff's rod as a boundary-value problem (arc length in l).

    r' = t (1 + F·t/EA),  frame' = κ × frame,  F' = −f,  M' = −r' × F − m,  M = (κ − κ⁰) + ⅔ twist;
    κ⁰ = out d2 − across d1 with d1 away from the axis at the clamp.
    """
    parallel = 2 * np.pi / (np.log(SLENDERNESS) - 0.5)
    perp = 4 * np.pi / (np.log(SLENDERNESS) + 0.5)
    roll = spin_drag * 4 * np.pi / SLENDERNESS**2
    found = None
    for share in (0.25, 0.5, 0.75, 1.0):
        spin = np.array([0, 0, share * omega_bar])[:, None]

        def slope(_: np.ndarray, y: np.ndarray, spin: np.ndarray = spin) -> np.ndarray:
            r, t, d, F, M = y[:3], y[3:6], y[6:9], y[9:12], y[12:15]
            other = np.cross(t, d, axis=0)
            velocity = np.cross(spin, r, axis=0)
            f = -(parallel - perp) * (t * velocity).sum(0) * t - perp * velocity
            m = -roll * (spin * t).sum(0) * t
            twist = natural_twist + 1.5 * (M * t).sum(0)
            turn = ((M * d).sum(0) - across) * d + ((M * other).sum(0) + out) * other + twist * t
            along = t * (1 + (F * t).sum(0) * 0.25 / SLENDERNESS**2)
            turned = [np.cross(turn, t, axis=0), np.cross(turn, d, axis=0)]
            return np.vstack([along, *turned, -f, -np.cross(along, F, axis=0) - m])

        def ends(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return np.concatenate([a[:3] - [OFFSET, 0, 0], a[3:6] - [0, 0, -1], a[6:9] - [1, 0, 0], b[9:]])

        arc = np.linspace(0, 1, 101) if found is None else found.x
        start = np.zeros((15, len(arc))) if found is None else found.y
        if found is None:
            start[0], start[2], start[5], start[6] = OFFSET, -arc, -1, 1
        found = solve_bvp(slope, ends, arc, start, tol=1e-6, max_nodes=5000)
        assert found.success
    force, moment = found.y[9:12, 0], found.y[12:15, 0]
    return np.array([force[2], (np.cross([OFFSET, 0, 0], force) + moment)[2]])


@pytest.mark.parametrize(
    ("effects", "spin", "across", "out"),
    [
        ({}, 0.0, 0.0, 0.0),
        ({"tail_spin_drag": 1.0}, 1.0, 0.0, 0.0),
        ({"natural_curvature": 0.5}, 0.0, 0.5, 0.0),
        ({"natural_splay": -0.5}, 0.0, 0.0, -0.5),
        ({"tail_spin_drag": 1.0, "natural_curvature": -0.6, "natural_splay": 0.3}, 1.0, -0.6, 0.3),
        ({"natural_splay": 0.5, "natural_twist": 2.0}, 0.0, 0.0, 0.5),
    ],
)
def test_thrust_and_moment_of_framed_filaments(
    effects: dict[str, float], spin: float, across: float, out: float
) -> None:
    omega_bar = 8.0 * ROBOT.time_scale
    twist = effects.get("natural_twist", 0.0)
    found = extrapolated_loads(omega_bar, SLENDERNESS, OFFSET, **effects)
    assert found[[1, 3]] == pytest.approx(kirchhoff_loads(omega_bar, spin, across, out, twist), rel=1e-3)


def test_spin_drag_grows_the_moment_by_a_third() -> None:
    """−4.328e-4 N m without; the torque of a straight tail on top would be −6.015e-4."""
    unit = ROBOT.bending_stiffness / ROBOT.tail_length
    moment = extrapolated_loads(8.0 * ROBOT.time_scale, SLENDERNESS, OFFSET, tail_spin_drag=1.0)[3] * unit
    assert abs(moment) == pytest.approx(5.925e-4, rel=1e-3)


def lane(
    effects: dict[str, float], x: np.ndarray, x_dot: np.ndarray, natural_twist: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Edge forces (n, 3) and further clamp moment (3,) of one tail whose disc stands still."""
    row = direct.bodies(control(1, N=1, natural_twist=natural_twist, **effects))[0]
    body = body_of(row)
    n = len(x)
    geometry, moments = new_geometry(n, 1), np.zeros((1, 3))
    measure(geometry, x[:, None], (body.offset, 0.0, 0.0), body.axial_stiffness)
    motion = motion_at(body, np.array([0.0, 0.0, 0.0, -body.omega]), 0.0)
    add_frames(body, geometry, motion, 0, x_dot[:, None], moments)
    return geometry.force[:, 0], moments[0]


def bent(n: int, seed: int = 0) -> np.ndarray:
    """Free nodes (n, 3) of a tail bent out of a plane."""
    rng = np.random.default_rng(seed)
    edges = np.array([0.0, 0.0, -1.0]) + np.cumsum(0.25 * rng.normal(size=(n, 3)), 0)
    lengths = (1 + 0.01 * rng.normal(size=(n, 1))) / n
    return np.array([1 / 6.875, 0, 0]) + np.cumsum(edges / np.linalg.norm(edges, axis=1)[:, None] * lengths, 0)


def test_forces_are_those_of_the_framed_rod() -> None:
    """Energy with frames carried by parallel transport in time, differentiated automatically, θ in balance."""
    n, across, out, twist = 7, 0.8, -0.5, 1.1
    x = bent(n)
    force, _ = lane({"natural_curvature": across, "natural_splay": out}, x, np.zeros_like(x), twist)
    weight = torch.full((n,), 1 / n, dtype=torch.float64)
    weight[0] = 0.5 / n
    rod = FramedRod(
        4 * 34.375**2, weight, torch.tensor([[out, across]]).double() * weight[:, None], twist * weight
    )
    nodes = torch.cat([torch.tensor([[1 / 6.875, 0.0, 0.0]]), torch.as_tensor(x)]).double().requires_grad_()
    edge = (nodes[1:] - nodes[:-1]).detach()
    tangent = edge / edge.norm(dim=-1, keepdim=True)
    root = Frames(torch.tensor([[0.0, 0.0, -1.0]]).double(), torch.tensor([[1.0, 0.0, 0.0]]).double())
    frames = Frames.along(torch.cat([root.tangent, tangent]), root.director[0])
    frames = Frames(frames.tangent[1:], frames.director[1:])
    theta = torch.zeros(n, dtype=torch.float64, requires_grad=True)
    optimiser = torch.optim.LBFGS([theta], lr=1, max_iter=500, tolerance_grad=1e-12, tolerance_change=1e-16)

    def closure() -> torch.Tensor:
        optimiser.zero_grad()
        energy = rod.clamped_energy(nodes, theta, root, frames)
        energy.backward()
        return energy

    optimiser.step(closure)
    nodes.grad = None
    rod.clamped_energy(nodes, theta, root, frames).backward()
    on_nodes = -force
    on_nodes[:-1] += force[1:]
    assert nodes.grad is not None
    assert -nodes.grad[1:].numpy() == pytest.approx(on_nodes, abs=1e-6 * np.abs(on_nodes).max())


def test_the_rod_puts_no_force_and_no_moment_on_itself() -> None:
    """Forces of all edges on nodes and disc cancel, and so do their moments."""
    x = bent(9, seed=3)
    x_dot = np.random.default_rng(4).normal(size=x.shape)
    effects = {"natural_curvature": 0.4, "natural_splay": 0.7, "rate_dependent_modulus": 0.3}
    with_, moment = lane(effects, x, x_dot, natural_twist=2.0)
    without, _ = lane({}, x, x_dot)
    nodes = np.concatenate([[[1 / 6.875, 0, 0]], x])
    force = with_ - without
    assert np.cross(np.diff(nodes, axis=0), force).sum(0) == pytest.approx(moment, abs=1e-9)


def test_bending_viscosity_takes_power_and_gives_none() -> None:
    """Power = η Σ |κ̇|²/l_k; a turn of the whole tail, clamp and all, costs none."""
    for seed in range(5):
        x = bent(8, seed)
        x_dot = np.random.default_rng(seed).normal(size=x.shape)
        viscous = lane({"rate_dependent_modulus": 0.3}, x, x_dot)[0] - lane({}, x, x_dot)[0]
        rates = np.diff(np.concatenate([np.zeros((1, 3)), x_dot]), axis=0)
        assert (viscous * rates).sum() > 0
    straight = np.array([1 / 6.875, 0, 0]) + np.outer(np.arange(1, 9) / 8, [0, 0, -1.0])
    swing = np.zeros_like(straight)
    swing[:, 0] = -straight[:, 2] * 0.1
    hinge = lane({"rate_dependent_modulus": 0.3}, straight, swing)[0] - lane({}, straight, swing)[0]
    assert np.abs(hinge[1:]).max() < 1e-12  # only the joint at the clamp bends
    assert hinge[0, 0] == pytest.approx(0.3 * 16 * 8 * 0.1, rel=1e-9)  # η w κ̇/|e|, κ̇ = 0.1


@pytest.mark.parametrize("where", [(0.3, 0.1, -0.2), (0.02, 0.01, -0.5), (0.0, 0.0, -0.5), (0.1, 0.0, 0.9)])
def test_flow_of_a_straight_piece_is_the_integral_of_stokeslets(where: tuple[float, float, float]) -> None:
    start, end, force, spread = np.array([0.0, 0, 0]), np.array([0.05, 0, -1.0]), np.array([0.3, -1.0, 0.7]), 0.03

    def point(share: float) -> np.ndarray:
        r = np.array(where) - start - share * (end - start)
        R = np.sqrt(r @ r + spread**2)
        return ((1 / R + spread**2 / R**3) * force + (r @ force) * r / R**3) / (8 * np.pi)

    expected = quad_vec(point, 0, 1, epsabs=1e-10, points=(0.5,))[0]
    found = flow.stokeslets(where, tuple(start), tuple(end), tuple(force), spread)
    assert np.array(found) == pytest.approx(expected, rel=1e-7)


def test_nothing_flows_through_the_surface() -> None:
    """A piece and its image together: no normal velocity and no shear on the plane y = H."""
    start, end, force, height = (0.1, 0.2, 0.0), (0.3, -0.1, -0.8), (0.5, 0.9, -0.3), 0.6
    image = [(v[0], 2 * height - v[1], v[2]) for v in (start, end)]

    def velocity(y: float) -> np.ndarray:
        at = (0.4, y, -0.3)
        mirrored = (force[0], -force[1], force[2])
        own = np.array(flow.stokeslets(at, start, end, force, 0.03))
        return own + np.array(flow.stokeslets(at, *image, mirrored, 0.03))

    assert velocity(height)[1] == pytest.approx(0, abs=1e-15)
    shear = (velocity(height + 1e-4) - velocity(height - 1e-4))[[0, 2]] / 2e-4
    assert shear == pytest.approx([0, 0], abs=1e-8)


@pytest.mark.parametrize("tails", [2, 3, 4, 5])
def test_slow_tails_drag_each_other_as_much_as_rigid_rods(tails: int) -> None:
    """Torque against the closed form for evenly loaded rods on a ring (ours are loaded as the flow asks)."""
    few = {"N": tails, "omega_bar": 0.01}
    moments = []
    for share in (0.0, 1.0):
        groups = control(**few, tail_interaction=share)
        row = direct.bodies(groups)[0]
        found, x, u = direct.on_mesh(row, tails, 24)
        assert found
        wrench = orbit.tail_wrench(body_of(row), x, u, direct.differentiation(x.shape[1]))
        moments.append(wrench[3] / (0.01 + u[:, 3].mean()))
    j = np.arange(1, tails)
    distance = 2 / 6.875 * np.sin(np.pi * j / tails)
    s, e = np.arcsinh(1 / (2 * distance)), (1 + 4 * distance**2) ** -0.5
    more = (np.cos(2 * np.pi * j / tails) * s + np.cos(np.pi * j / tails) ** 2 * e).sum()
    own = np.log(34.375) + 0.5
    assert moments[1] / moments[0] == pytest.approx(own / (own + more), rel=0.05)


@pytest.mark.parametrize("name", OF_BEYOND)
def test_orbits_are_what_time_steps_settle_to(name: str) -> None:
    """Second order in the mesh: the finer one is four times nearer to the extrapolated orbit."""
    groups = control(N=3, **{name: catalogue()[name].typical})
    motion = orbits(groups)
    assert motion.converged.all()
    coarse, fine = (settle(groups, resolution=Resolution(n, 72)) for n in (12, 24))
    for key in ("omega_yr", "v_x", "v_z"):
        limit = getattr(motion, key)[0]
        away = [abs(getattr(m, key)[0] / limit - 1) for m in (coarse, fine)]
        assert away[1] < 5e-3
        assert away[1] < 0.45 * away[0] + 5e-4


def yaw_rates(groups: Groups) -> np.ndarray:
    """ω_yr on the phases that derivatives are taken on."""
    return orbits(groups, phases=direct.MANY).omega_yr


@pytest.mark.parametrize("name", OF_BEYOND)
@pytest.mark.parametrize("at", ["null", "typical"])
def test_sensitivities_are_differences(name: str, at: str) -> None:
    effect = catalogue()[name]
    size, width = getattr(effect, at), 1e-3 * (effect.typical - effect.null)
    if name == "contact_line" and at == "null":
        pytest.skip("friction has no derivative where it starts: its bounds end at its null")
    found = sensitivities(control(N=3, **{name: size}), (name, "C_t"))
    around = torch.tensor([size - width, size + width])  # also below a null that is a bound
    low, high = yaw_rates(replace(control(2, N=3), effects={name: around}))
    slope = (high - low) / (2 * width)
    assert found.derivatives["omega_yr_bar"][0, 0] == pytest.approx(slope, rel=2e-3, abs=1e-5)
    C_t = 3.0
    low, high = yaw_rates(control(2, N=3, C_t=[C_t * 0.999, C_t * 1.001], **{name: size}))
    slope = (high - low) / (0.002 * C_t)
    assert found.derivatives["omega_yr_bar"][0, 1] == pytest.approx(slope, rel=2e-3)


def test_effects_of_beyond_stand_beside_each_other() -> None:
    sizes = {name: 0.3 * catalogue()[name].typical for name in OF_BEYOND}
    assert orbits(control(N=4, **sizes)).converged.all()


def test_tensor_steps_refuse_what_they_leave_out() -> None:
    swimmer, _ = single_filament(6, 5.0, SLENDERNESS, OFFSET, tail_spin_drag=1.0)
    with pytest.raises(InputError, match="spin_drag"):
        at_rest(swimmer)


def test_a_natural_arc_is_what_a_free_tail_takes() -> None:
    """A motor that hardly turns leaves the tail on its natural arc of angle ε, against the turn of the disc."""
    _, x = held_loads(1e-4, SLENDERNESS, OFFSET, edges=24, natural_curvature=0.5)
    assert x[-1] == pytest.approx([OFFSET, -2 * (1 - np.cos(0.5)), -2 * np.sin(0.5)], abs=2e-4)
