"""Numbers of Mironov and Mironov (2007): visits to several moving targets."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from experiments.common.published_number import COMPUTED, Origin, Progress, PublishedNumber, Reference, Reproduction
from experiments.multipoint.file import load_multipoint
from infoset.arrays import Floats
from rendezvous.multipoint import (
    DriftingTargets,
    KeplerTargets,
    KeplerTour,
    Meet,
    Nodes,
    Target,
    TimeLimits,
    Tour,
    best_order,
    best_times,
    solve_segments,
)
from rendezvous.relative_motion import TimeVaryingMotion

PAPER = "multipoint"
TITLE = "Mironov and Mironov (2007), visits to several moving targets"
REMARKS = (
    "The paper prints no numbers. The numbers here are reference values of the corrected conditions, on which four "
    "independent solvers agree; the closed forms are exact.",
    "The condition of the times is printed with the target's velocity twice; dI/dt_i = D_i' (V_i - V) is right.",
    "B_2 of the elimination for N = 2 is R43(t2, t1) alone; costates between nodes have R33, R34, R43 and R44 where "
    "R32 is printed; the line on jumps has the sign that is missing in (11).",
)
_REFERENCE = Reference(PAPER, COMPUTED, Origin.OTHER)
_EXACT = Reference(PAPER, COMPUTED, Origin.EXACT)
_FLYBYS = {
    2: {
        "I (m^2/s^3)": ("0.007795510261",),
        "dI/dt (m^2/s^4)": ("-6.240605504e-6", "-5.373459638e-6"),
        "best times (s)": ("1783.951356",),
        "I at best times (m^2/s^3)": ("0.006940766364",),
        "I, rendezvous at the last (m^2/s^3)": ("0.01448132912",),
        "the same at best times (m^2/s^3)": ("0.0143926742",),
        "lambda_r(0)": ("-4.07572317e-6", "5.907845349e-6", "-6.002510892e-8"),
        "V(t1) (m/s)": ("0.2196204319", "0.4269567271", "0.03236416977"),
    },
    3: {
        "I (m^2/s^3)": ("0.02114228011",),
        "dI/dt (m^2/s^4)": ("-7.836556602e-6", "-7.232202377e-6", "-3.260167949e-6"),
        "best times (s)": ("1521.323343", "3015.041612"),
        "I at best times (m^2/s^3)": ("0.01835844972",),
        "I, rendezvous at the last (m^2/s^3)": ("0.02381594121",),
        "the same at best times (m^2/s^3)": ("0.02315574123",),
    },
}


def reproduce(progress: Progress) -> Reproduction:
    """Compute the numbers."""
    numbers: list[PublishedNumber] = []
    problems = []
    for done, count in enumerate(_FLYBYS):
        problem = load_multipoint(f"service-{count}")
        problems.append((problem.name, problem.hash))
        numbers += _visits(count)
        progress(0.2 * (done + 1))
    numbers += _priced()
    progress(0.5)
    numbers += _orders()
    progress(0.8)
    numbers += [*_splines(), *_kepler()]
    progress(1.0)
    return Reproduction(PAPER, TITLE, tuple(problems), tuple(numbers), REMARKS)


def _tour(count: int, meets: Sequence[Meet] | None = None) -> tuple[Tour, Floats]:
    """Return the tour of a built-in problem, with other kinds of visits if given, and its times."""
    problem = load_multipoint(f"service-{count}")
    tour, times = problem.tour, problem.times_s
    assert isinstance(tour, Tour)
    assert isinstance(tour.targets, DriftingTargets)
    assert times is not None
    if meets is not None:
        described = tuple(replace(target, meet=meet) for target, meet in zip(tour.targets.targets, meets, strict=True))
        tour = replace(tour, targets=replace(tour.targets, targets=described))
    return tour, times


def _visits(count: int) -> list[PublishedNumber]:
    tour, times = _tour(count)
    order, limits = range(count), TimeLimits(latest_s=float(times[-1]))
    path, best = tour.fly(order, times), best_times(tour, order, limits, [times])
    last, _ = _tour(count, [*[Meet.FLYBY] * (count - 1), Meet.RENDEZVOUS])
    computed: dict[str, Sequence[float] | Floats] = {
        "I (m^2/s^3)": [path.cost],
        "dI/dt (m^2/s^4)": path.time_gradient,
        "best times (s)": best.time_s[:-1],
        "I at best times (m^2/s^3)": [best.path.cost],
        "I, rendezvous at the last (m^2/s^3)": [last.fly(order, times).cost],
        "the same at best times (m^2/s^3)": [best_times(last, order, limits, [times]).path.cost],
        "lambda_r(0)": path.costate_start[:3],
        "V(t1) (m/s)": path.arrival_states[0, 3:],
    }
    return [
        _REFERENCE.number(f"N = {count}", name if len(printed) == 1 else f"{name}, {i}", text, float(ours))
        for name, printed in _FLYBYS[count].items()
        for i, (text, ours) in enumerate(zip(printed, computed[name], strict=True), start=1)
    ]


def _priced() -> list[PublishedNumber]:
    tour, times = _tour(2)
    best = best_times(tour, (0, 1), TimeLimits(price_per_s=1e-6), [times])
    printed = {"t1 (s)": "2905.083078", "t2 (s)": "4690.157388", "I (m^2/s^3)": "0.0008170807218"}
    source = "N = 2, last time at 1e-6 a second"
    return _REFERENCE.numbers(source, printed, [*best.time_s, best.path.cost])


def _orders() -> list[PublishedNumber]:
    tour, times = _tour(3)
    worst = max(tour.fly(order, times).cost for order in itertools.permutations(range(3)))
    best = best_order(tour, TimeLimits(latest_s=float(times[-1])))
    printed = {
        "I of the worst order, given times (m^2/s^3)": "0.05442751",
        "I of the best order, best times (m^2/s^3)": "0.008734876263",
    }
    return _REFERENCE.numbers("N = 3", printed, [worst, best.objective])


def _double_integrator() -> TimeVaryingMotion:
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    return TimeVaryingMotion(lambda at: np.broadcast_to(matrix, (len(at), 6, 6)))


def _splines() -> list[PublishedNumber]:
    """Return numbers in free space, where the path is a cubic spline, clamped at the start and natural at the end."""
    motion, at, states = _double_integrator(), np.array([1.0, 2.0, 3.0]), np.zeros((3, 6))
    states[:, 0] = [1.0, -1.0, 2.0]
    nodes = Nodes(at, at, states, states, 0.0 * states, 0.0 * states, np.zeros(3, dtype=bool))
    path = solve_segments(motion, 0.0, np.zeros(6), nodes)
    exact = {"I": 534 / 13}
    exact |= {f"D, {i}": value / 13 for i, value in enumerate((450, -366, 126), start=1)}
    exact |= {f"V, {i}": value / 13 for i, value in enumerate((-9, -3, 60), start=1)}
    printed = {name: f"{value:.9f}" for name, value in exact.items()}
    ours = [path.cost, *path.jumps[:, 0], *path.arrival_states[:, 3]]
    numbers = _EXACT.numbers("cubic spline", printed, ours)
    there = np.zeros((2, 6))
    there[0, 0] = 1.0
    tour = Tour(motion, DriftingTargets((Target("out"), Target("back")), motion, there), np.zeros(6))
    back = best_times(tour, (0, 1), TimeLimits(latest_s=1.0))
    printed = {"t1": f"{2.0 - 2.0**0.5:.9f}", "I": f"{1.5 * (1.0 + 2.0**0.5) ** 4:.8f}"}
    source = "out to 1 and back by T = 1"
    return numbers + _EXACT.numbers(source, printed, [back.time_s[0], back.path.cost])


def _kepler() -> list[PublishedNumber]:
    """Return a number for a point mass, mu = 1, and targets on circles."""
    states = []
    for radius, phase, inclination in ((1.01, 0.02, 0.005), (1.02, 0.05, -0.01)):
        (c, s), tilt = (np.cos(phase), np.sin(phase)), np.array([1.0, np.cos(inclination), np.sin(inclination)])
        states.append(np.concatenate([radius * np.array([c, s, s]) * tilt, radius**-0.5 * np.array([-s, c, c]) * tilt]))
    targets = KeplerTargets((Target("first"), Target("second")), np.array(states), np.zeros(2), 1.0)
    path = KeplerTour(targets, np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0])).fly((0, 1), [2.0, 4.0])
    return [_REFERENCE.number("nonlinear", "I (mu = 1)", "4.267529653e-5", path.cost)]
