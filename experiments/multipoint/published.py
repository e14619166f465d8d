"""Mironov and Mironov (2007): visits to several moving targets."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from experiments.common.published_number import COMPUTED, Progress, PublishedNumber, Reference, Reproduction
from experiments.multipoint.file import load_multipoint
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

Floats = NDArray[np.float64]

PAPER = "multipoint"
TITLE = "Mironov and Mironov (2007), visits to several moving targets"
REMARKS = (
    "The paper prints no numbers. Those here are reference values of the corrected conditions, on which four "
    "independent solvers agreed; closed forms are exact.",
    "Condition of the times: printed with the target's velocity twice; dI/dt_i = D_i' (V_i - V) is right.",
    "B_2 of the elimination for N = 2 is R43(t2, t1) alone; costates between nodes have R33, R34, R43 and R44 where "
    "R32 is printed; the line on jumps has the sign that (11) has not.",
)
_REFERENCE = Reference(PAPER, COMPUTED)
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
    """Compute the numbers.

    Parameters
    ----------
    progress : callable
        Told the fraction done.

    Returns
    -------
    Reproduction
    """
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
    """Return a built-in problem's tour, with other ways to meet, and its times."""
    problem = load_multipoint(f"service-{count}")
    tour, times = problem.tour, problem.times_s
    assert isinstance(tour, Tour)
    assert isinstance(tour.targets, DriftingTargets)
    assert times is not None
    if meets is not None:
        described = tuple(replace(each, meet=meet) for each, meet in zip(tour.targets.targets, meets, strict=True))
        tour = replace(tour, targets=replace(tour.targets, targets=described))
    return tour, times


def _visits(count: int) -> list[PublishedNumber]:
    tour, times = _tour(count)
    order, limits = range(count), TimeLimits(latest_s=float(times[-1]))
    path, best = tour.fly(order, times), best_times(tour, order, limits, [times])
    last, _ = _tour(count, [*[Meet.FLYBY] * (count - 1), Meet.RENDEZVOUS])
    found: dict[str, Sequence[float] | Floats] = {
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
        _REFERENCE.number(f"reference, N = {count}", _indexed(name, place, len(printed)), text, float(ours))
        for name, printed in _FLYBYS[count].items()
        for place, (text, ours) in enumerate(zip(printed, found[name], strict=True), start=1)
    ]


def _indexed(name: str, place: int, count: int) -> str:
    return name if count == 1 else f"{name}, {place}"


def _priced() -> list[PublishedNumber]:
    tour, times = _tour(2)
    found = best_times(tour, (0, 1), TimeLimits(price_per_s=1e-6), [times])
    rows = (
        ("t1 (s)", "2905.083078", found.time_s[0]),
        ("t2 (s)", "4690.157388", found.time_s[1]),
        ("I (m^2/s^3)", "0.0008170807218", found.path.cost),
    )
    return [_REFERENCE.number("reference, N = 2, last time at 1e-6 a second", *row) for row in rows]


def _orders() -> list[PublishedNumber]:
    tour, times = _tour(3)
    worst = max(tour.fly(order, times).cost for order in itertools.permutations(range(3)))
    best = best_order(tour, TimeLimits(latest_s=float(times[-1])))
    return [
        _REFERENCE.number("reference, N = 3", "I of the worst order, given times (m^2/s^3)", "0.05442751", worst),
        _REFERENCE.number(
            "reference, N = 3", "I of the best order, best times (m^2/s^3)", "0.008734876263", best.objective
        ),
    ]


def _double_integrator() -> TimeVaryingMotion:
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    return TimeVaryingMotion(lambda at: np.broadcast_to(matrix, (len(at), 6, 6)))


def _splines() -> list[PublishedNumber]:
    """Free space, where the path is a cubic spline clamped at the start and natural at the end."""
    motion, at, states = _double_integrator(), np.array([1.0, 2.0, 3.0]), np.zeros((3, 6))
    states[:, 0] = [1.0, -1.0, 2.0]
    nodes = Nodes(at, at, states, states, 0.0 * states, 0.0 * states, np.zeros(3, dtype=bool))
    path = solve_segments(motion, 0.0, np.zeros(6), nodes)
    exact = [
        ("I", path.cost, 534 / 13),
        *((f"D, {place}", path.jumps[place - 1, 0], value / 13) for place, value in enumerate((450, -366, 126), 1)),
        *(
            (f"V, {place}", path.arrival_states[place - 1, 3], value / 13)
            for place, value in enumerate((-9, -3, 60), 1)
        ),
    ]
    numbers = [
        _REFERENCE.number("closed form, cubic spline", name, f"{value:.9f}", float(ours)) for name, ours, value in exact
    ]
    there = np.zeros((2, 6))
    there[0, 0] = 1.0
    tour = Tour(motion, DriftingTargets((Target("out"), Target("back")), motion, there), np.zeros(6))
    back = best_times(tour, (0, 1), TimeLimits(latest_s=1.0))
    source = "closed form, out to 1 and back by T = 1"
    numbers.append(_REFERENCE.number(source, "t1", f"{2.0 - 2.0**0.5:.9f}", float(back.time_s[0])))
    numbers.append(_REFERENCE.number(source, "I", f"{1.5 * (1.0 + 2.0**0.5) ** 4:.8f}", back.path.cost))
    return numbers


def _kepler() -> list[PublishedNumber]:
    """The gravity of one point, mu = 1, targets on circles."""
    states = []
    for radius, phase, inclination in ((1.01, 0.02, 0.005), (1.02, 0.05, -0.01)):
        (c, s), tilt = (np.cos(phase), np.sin(phase)), np.array([1.0, np.cos(inclination), np.sin(inclination)])
        states.append(np.concatenate([radius * np.array([c, s, s]) * tilt, radius**-0.5 * np.array([-s, c, c]) * tilt]))
    targets = KeplerTargets((Target("first"), Target("second")), np.array(states), np.zeros(2), 1.0)
    path = KeplerTour(targets, np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0])).fly((0, 1), [2.0, 4.0])
    return [_REFERENCE.number("reference, nonlinear", "I (mu = 1)", "4.267529653e-5", path.cost)]
