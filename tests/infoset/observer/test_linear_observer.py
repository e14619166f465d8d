"""Observers of linear systems: exact sets, linear programs, and true states whose errors are at
their bounds.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from infoset import (
    AngleSensor,
    ConvexPolygons,
    InformationSet,
    LinearObserver,
    Model,
    SetModel,
    StateBox,
    Zonotope,
)
from infoset.arrays import Floats
from infoset.engine.section_life import SUM_SLACK
from infoset.geometry.polytope import HIGHS, Polytope
from infoset.observer.steps import enlarge
from tests.infoset.geometry.test_polygon_oracle import Exact, exact_clip, hull
from tests.rationals import Fraction

PUBLISHED: dict[str, Any] = json.loads(
    (Path(__file__).parents[2] / "data" / "observer" / "alamo-2005.json").read_text(
        encoding="utf-8"
    )
)
"""Alamo, Bravo and Camacho (2005), with the measurements of the unit tests of CORA."""


def published(runs: int | None = None) -> LinearObserver:
    return LinearObserver(
        PUBLISHED["A"],
        PUBLISHED["C"],
        Zonotope([0.0, 0.0], PUBLISHED["initial_generators"]),
        noise=PUBLISHED["noise_half_width"],
        disturbance=Zonotope([0.0, 0.0], PUBLISHED["disturbance_generators"]),
        runs=runs,
    )


def measurements() -> Floats:
    return np.array(PUBLISHED["y"]).T


def test_vertices_of_an_estimate_have_no_rows_of_uninitialised_memory() -> None:
    one = published()
    batch = published(runs=3)
    for observer, y in ((one, measurements()[0]), (batch, [measurements()[0]] * 3)):
        observer.update(y)
        observer.predict()

    polygon = one.estimate().polygons
    assert polygon.vertices.shape == (polygon.counts, 2)
    assert np.isfinite(polygon.vertices).all()

    # One run is cut again, one becomes empty: their rows after the vertices that are left are NaN.
    y = measurements()[1]
    batch.update(np.stack([y, y + 1e3, np.full(y.shape, np.nan)]))
    polygons = batch.estimate().polygons
    assert len(set(polygons.counts.tolist())) == 3
    assert polygons.counts[1] == 0
    used = np.arange(polygons.vertices.shape[1]) < polygons.counts[:, None]
    assert used.any(axis=0).all()
    assert (np.isfinite(polygons.vertices).all(axis=-1) == used).all()
    assert np.isnan(polygons.vertices[~used]).all()


# Exact rational sets
# --------------------------------------------------------------------------------------------------


def exact_sets() -> list[list[Exact]]:
    (a, b), (c, d) = [[Fraction(value) for value in row] for row in PUBLISHED["A"]]
    row = tuple(Fraction(value) for value in PUBLISHED["C"][0])
    normal: Exact = (row[0], row[1])
    half = Fraction(PUBLISHED["noise_half_width"])
    w = [Fraction(value) for value in PUBLISHED["disturbance_generators"][0]]
    points = [(Fraction(x), Fraction(y)) for x, y in ((-3, -3), (3, -3), (3, 3), (-3, 3))]
    sets = []
    for k, y in enumerate(Fraction(value) for value in PUBLISHED["y"][0]):
        if k:
            moved = [(a * x + b * z, c * x + d * z) for x, z in points]
            points = hull(
                [(x + sign * w[0], z + sign * w[1]) for x, z in moved for sign in (-1, 1)]
            )
        points = exact_clip(points, normal, y - half, y + half)
        sets.append(points)
    return sets


def test_representation_of_an_estimate_has_its_bounds() -> None:
    box = Zonotope.box([0.0, -1.0], [0.0, 1.0])
    still = np.eye(2)
    one = LinearObserver(still, [[0.0, 1.0]], box, noise=0.5)
    assert repr(one.estimate()) == "<estimate of 2 states at step 0: 0 to 0, -1 to 1>"
    one.update([9.0])
    assert repr(one.estimate()) == "<estimate of 2 states at step 0: no state is possible>"

    many = LinearObserver(still, [[0.0, 1.0]], box, noise=0.5, runs=2)
    many.update([[0.0], [9.0]])
    assert (
        repr(many.estimate())
        == "<estimate of 2 states at step 0: 2 runs, 1 of them without a possible state>"
    )


def test_sets_of_the_published_example_equal_the_exact_ones() -> None:
    estimates = published().run(measurements())
    assert len(estimates) == 20
    exact = exact_sets()
    assert [len(points) for points in exact] == PUBLISHED["exact_rational"]["counts"]
    for estimate, points, interval_hull in zip(
        estimates, exact, PUBLISHED["exact_rational"]["hull_of_each_step"], strict=True
    ):
        wanted = np.array([[float(x), float(y)] for x, y in points])
        ours = estimate.polygons.polygon()
        assert ours.shape == wanted.shape
        first = int(np.abs(ours - wanted[0]).max(axis=1).argmin())
        np.testing.assert_allclose(np.roll(ours, -first, axis=0), wanted, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(
            [estimate.lower, estimate.upper], interval_hull, rtol=0.0, atol=1e-12
        )
        assert (estimate.lower <= wanted.min(axis=0)).all()
        assert (estimate.upper >= wanted.max(axis=0)).all()


# Linear programs
# --------------------------------------------------------------------------------------------------


class Programs:
    """Bounds of the states of a system with A, B = 0, C and box disturbance generators, by linear
    programs.
    """

    def __init__(
        self, a: Floats, c: Floats, generators: Floats, half: Floats, noise: Floats, y: Floats
    ) -> None:
        states = len(a)
        steps = len(y)
        unknowns = states + len(generators) * (steps - 1)
        state = np.zeros((states, unknowns))
        state[:, :states] = np.diag(half)
        self.states = [state]
        rows = []
        limits = []
        for k in range(1, steps):
            state = a @ state
            first = states + len(generators) * (k - 1)
            state[:, first : first + len(generators)] += generators.T
            self.states.append(state)
        for state, measured in zip(self.states, y, strict=True):
            for row, value, width in zip(c @ state, measured, noise, strict=True):
                if not np.isnan(value):
                    rows += [row, -row]
                    limits += [value + width, width - value]
        self.rows = np.array(rows)
        self.limits = np.array(limits)

    def farthest(self, step: int, direction: Floats) -> Floats:
        """Coefficients of a motion whose state at a step is farthest along a direction."""
        cost = -direction @ self.states[step]
        optimum = linprog(
            cost, self.rows, self.limits, bounds=(-1.0, 1.0), method="highs", options=HIGHS
        )
        assert optimum.status == 0
        return np.asarray(optimum.x)

    def hull(self, step: int) -> tuple[list[float], list[float]]:
        """Minimum and maximum of each state at a step."""
        state = self.states[step]
        axes = list(zip(state, np.eye(len(state)), strict=True))
        lower = [float(row @ self.farthest(step, -unit)) for row, unit in axes]
        upper = [float(row @ self.farthest(step, unit)) for row, unit in axes]
        return lower, upper


def chain(axes: int, order: int) -> tuple[Floats, Floats, Floats]:
    """A, C and disturbance generators of coupled chains of integrators, measured at the first."""
    step = 0.5
    block = np.eye(order) + step * np.eye(order, k=1)
    block[-1, -1] = 0.9
    a = np.kron(np.eye(axes), block)
    a[0, -1] += 0.1
    c = np.kron(np.eye(axes), np.eye(1, order))
    generators = 0.1 * np.kron(np.eye(axes), np.eye(order)[-1:])
    return np.asarray(a, np.float64), np.asarray(c, np.float64), np.asarray(generators, np.float64)


def simulated(
    a: Floats,
    c: Floats,
    generators: Floats,
    noise: Floats,
    steps: int,
    generator: np.random.Generator,
) -> tuple[Floats, Floats]:
    """States and measurements whose errors are at their bounds, from a corner of the unit box."""
    states = [generator.choice([-1.0, 1.0], len(a))]
    measured = []
    for k in range(steps):
        if k:
            states.append(
                a @ states[-1] + generator.choice([-1.0, 1.0], len(generators)) @ generators
            )
        measured.append(c @ states[-1] + generator.choice([-1.0, 1.0], len(c)) * noise)
    return np.array(states), np.array(measured)


@pytest.mark.parametrize(
    ("axes", "order", "steps"), [(2, 3, 4), (1, 3, 8), (2, 2, 7), (1, 2, 9), (1, 1, 6)]
)
def test_hulls_equal_linear_programs(axes: int, order: int, steps: int) -> None:
    a, c, generators = chain(axes, order)
    noise = np.full(axes, 0.2)
    rng = np.random.default_rng(6)
    states, _ = simulated(a, c, generators, noise, steps, rng)
    y = states @ c.T + rng.uniform(-0.15, 0.15, (steps, axes))
    y[2, 0] = np.nan
    size = len(a)
    start = Zonotope.box(-np.ones(size), np.ones(size))
    disturbance = Zonotope(np.zeros(size), generators)
    observer = LinearObserver(a, c, start, noise=noise, disturbance=disturbance, max_facets=None)
    estimates = observer.run(y)
    for step in (steps - 1, steps // 2):
        wanted = Programs(a, c, generators, np.ones(size), noise, y[: step + 1]).hull(step)
        np.testing.assert_allclose(
            [estimates[step].lower, estimates[step].upper], wanted, rtol=0.0, atol=1e-9
        )
    programs = Programs(a, c, generators, np.ones(size), noise, y)
    for estimate in observer.smooth(estimates):
        hulls = [estimate.lower, estimate.upper]
        np.testing.assert_allclose(hulls, programs.hull(estimate.step), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    "units",
    [[1e9, 1.0, 1e-9] * 2, [1.0, 1e-9, 1e9, 1e-9, 1.0, 1e9], [1e9] * 3 + [1e-9] * 3, [1e-9] * 6],
)
def test_units_of_six_states_do_not_matter(units: list[float]) -> None:
    """Formerly sets in mixed units were too wide, with thousands of vertices after two steps."""
    a, c, generators = chain(2, 3)
    rng = np.random.default_rng(6)
    states, _ = simulated(a, c, generators, np.full(2, 0.2), 3, rng)
    y = states @ c.T + rng.uniform(-0.15, 0.15, (3, 2))
    hulls = []
    for scale in (np.ones(6), np.array(units)):
        observer = LinearObserver(
            a * scale[:, None] / scale,
            c / scale,
            Zonotope.box(-scale, scale),
            noise=0.2,
            disturbance=Zonotope(np.zeros(6), generators * scale),
            max_facets=None,
        )
        estimates = observer.run(y)
        sets = estimates + observer.smooth(estimates)
        hulls.append([[estimate.lower / scale, estimate.upper / scale] for estimate in sets])
    np.testing.assert_allclose(hulls[1], hulls[0], rtol=0.0, atol=1e-9)


# The true state
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("matrix", ["rotation", "shear", "singular", "mirror", "zero", "growing"])
def test_true_state_is_inside_the_sets_of_other_systems(matrix: str) -> None:
    a = {
        "rotation": [[0.8, -0.6], [0.6, 0.8]],
        "shear": [[1.0, 0.1], [0.0, 1.0]],
        "singular": [[0.5, 0.25], [1.0, 0.5]],
        "mirror": [[0.0, 1.0], [1.0, 0.0]],
        "zero": [[0.0, 0.0], [0.0, 0.0]],
        "growing": [[1.1, 0.3], [-0.2, 1.2]],
    }[matrix]
    rng = np.random.default_rng(3)
    runs = 300
    steps = 40
    c = np.array([[1.0, 0.0], [0.3, -1.0]])
    b = np.array([[0.1], [1e3]])
    offset = np.array([1.0, -1e3])
    corners = np.array([[0.0, 0.0], [0.2, -0.1], [0.1, 0.3]])
    observer = LinearObserver(
        a,
        c,
        Zonotope.box([-1.0, 9e3], [1.0, 1e4]),
        noise=[0.1, 0.2],
        disturbance=ConvexPolygons.from_points(corners),
        input_matrix=b,
        offset=offset,
        runs=runs,
    )
    x = np.column_stack([rng.choice([-1.0, 1.0], runs), rng.choice([9e3, 1e4], runs)])
    for k in range(steps):
        if k:
            u = rng.choice([-1.0, 1.0], (runs, 1))
            observer.predict(u)
            x = x @ np.array(a).T + u @ b.T + offset + corners[rng.integers(0, 3, runs)]
        y = x @ c.T + rng.choice([-1.0, 1.0], (runs, 2)) * [0.1, 0.2]
        y[rng.random((runs, 2)) < 0.3] = np.nan
        observer.update(y)
        assert observer.estimate().polygons.contains(x).all(), k
    assert (observer.inconsistency.step == -1).all()


TURN = [[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]
DRIFT = [[1.0, 0.5], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("a", "half", "noise", "w", "steps"),
    [
        (TURN, [1.0, 1.0], 0.0, [0.1, 0.0], 200),
        (TURN, [1.0, 1.0], 0.1, [0.0, 0.0], 300),
        (TURN, [1.0, 1.0], 0.0, [0.0, 0.0], 300),
        (DRIFT, [1e6, 1e-3], 10.0, [1e-3, 1e-5], 200),
        (DRIFT, [0.0, 0.0], 1.0, [1e-3, 1e-2], 200),
        ([[1.3, 0.5], [0.0, 0.7]], [1.0, 1.0], 1.0, [0.1, 0.01], 60),
    ],
    ids=[
        "exact measurements",
        "no disturbance",
        "no errors",
        "unlike scales",
        "known start",
        "unstable",
    ],
)
def test_true_state_is_inside_thin_sets_of_many_steps(
    a: list[list[float]], half: list[float], noise: float, w: list[float], steps: int
) -> None:
    rng = np.random.default_rng(8)
    runs = 100
    matrix = np.array(a)
    observer = LinearObserver(
        a,
        [[1.0, 0.0]],
        Zonotope([0.0, 0.0], np.diag(half)),
        noise=noise,
        disturbance=Zonotope([0.0, 0.0], [w]),
        runs=runs,
    )
    x = rng.choice([-1.0, 1.0], (runs, 2)) * half
    for k in range(steps):
        if k:
            observer.predict()
            x = x @ matrix.T + rng.choice([-1.0, 1.0], (runs, 1)) * w
        observer.update(x[:, :1] + rng.choice([-1.0, 1.0], (runs, 1)) * noise)
        polygons = observer.estimate().polygons
        assert polygons.contains(x).all(), k
        assert polygons.counts.max() <= 60


def test_polygons_of_many_vertices_contain_the_exact_set() -> None:
    observer = LinearObserver(
        [[1.0, 0.1], [0.0, 1.0]],
        [[1.0, 0.0]],
        Zonotope([0.0, 0.0], np.eye(2)),
        noise=1.0,
        disturbance=Zonotope([0.0, 0.0], [[1e-3, 1e-2]]),
    )
    for _ in range(400):
        observer.predict()
    estimate = observer.estimate()
    assert estimate.polygons.counts == 512
    # The support of a sum is the sum of supports.
    for direction in ([1.0, 0.0], [0.3, -1.0], [-1.0, 2.0]):
        wanted = 0.0
        d = np.array(direction)
        for _ in range(400):
            wanted += float(abs(d @ [1e-3, 1e-2]))
            d = d @ [[1.0, 0.1], [0.0, 1.0]]
        wanted += np.abs(d).sum()
        ours = float(estimate.polygons.support_function(direction))
        assert wanted <= ours <= wanted * (1.0 + 1e-4)


def test_true_state_is_inside_smoothed_sets() -> None:
    rng = np.random.default_rng(4)
    a = np.array(PUBLISHED["A"])
    c = np.array(PUBLISHED["C"])
    w = np.array(PUBLISHED["disturbance_generators"])
    runs = 500
    observer = published(500)
    states = [rng.choice([-3.0, 3.0], (runs, 2))]
    for _ in range(14):
        states.append(states[-1] @ a.T + rng.choice([-1.0, 1.0], (runs, 1)) * w)
    y = np.array([x @ c.T + rng.choice([-0.2, 0.2], (runs, 1)) for x in states])
    for estimate, x in zip(observer.smooth(observer.run(y)), states, strict=True):
        assert estimate.polygons.contains(x).all()


def test_section_of_the_interception_equals_the_sets_of_an_observer() -> None:
    step_s = 0.5
    limit = 0.005
    box = StateBox(
        z_m=(-2e3, 2e3), x_m=(5.5e6, 6.1e6), vz_m_s=(-100.0, 100.0), vx_m_s=(-59e3, -57e3)
    )
    sensor = AngleSensor(
        period_s=step_s,
        error_at_nominal_range_rad=1.5e-4,
        error_at_zero_range_rad=2.3e-4,
        nominal_range_m=5.8e6,
    )
    information = InformationSet(
        SetModel(58e3, step_s, box, sensor, disturbance_m_s2=limit, sections=5, model=Model.PAPER)
    )
    rng = np.random.default_rng(1)
    angles = (300.0 + 20.0 * step_s * np.arange(15)) / (5.8e6 - 58e3 * step_s * np.arange(15))
    angles += rng.uniform(-1.5e-4, 1.5e-4, 15)
    information.measure_angle(angles[0])
    start = information.sections()[2]
    ranges = start.range_m - 58e3 * step_s * np.arange(15)
    widths = np.array([float(sensor.error_bound(x)) * x for x in ranges])
    observer = LinearObserver(
        [[1.0, 0.0], [step_s, 1.0]],
        np.array([[[0.0, 1.0 / width]] for width in widths]),
        start.polygons[0],
        noise=1.0,
        disturbance=Zonotope([0.0, 0.0], [[limit * step_s, 0.5 * limit * step_s**2]]),
    )
    for k in range(1, 15):
        information.predict()
        information.measure_angle(angles[k])
        observer.predict()
        observer.update([angles[k] * ranges[k] / widths[k]])
    section = information.sections()[2]
    assert section.range_m == pytest.approx(ranges[-1])
    assert section.polygons[0].hausdorff_distance(observer.estimate().polygons) < 1e-9


# Formerly lost the true state: seeds 216 and 252, with exact measurements, a singular matrix and a
# flat initial set; seeds 1949 and 3147, with initial sets whose known coordinates were rounding
# errors. Seeds 100 to 372: a state that is zero at first, in units far from one. Seeds 639, 1172,
# 1397, 1622, 1843, 1885 and 1948: sharp corners of a thin layer, which vertices with more than n
# facets did not reach. Seed 2217: a set between facets that are nearly opposite, whose sum with a
# segment rounding decides even for a box.
HARD = [
    100,
    122,
    125,
    216,
    232,
    244,
    252,
    280,
    372,
    639,
    1172,
    1397,
    1622,
    1843,
    1885,
    1948,
    1949,
    2217,
    3147,
]


@pytest.mark.parametrize(
    "seed",
    [
        *range(8),
        *range(40, 48),
        *HARD,
        *(
            pytest.param(seed, marks=pytest.mark.thorough)
            for seed in (*range(8, 20), *range(48, 60))
        ),
    ],
)
def test_true_state_is_inside_for_any_matrices_of_other_numbers_of_states(seed: int) -> None:
    """Singular and regular matrices, flat initial sets, exact measurements, gaps, units that differ
    by 1e18.
    """
    rng = np.random.default_rng(seed)
    states = int(rng.choice([1, 3, 3, 4]))
    outputs = int(rng.integers(1, 3))
    a = rng.normal(size=(states, states)) * rng.choice([0.3, 0.6])
    if seed % 4 == 0:
        a[-1] = 0.0
    if seed % 5 == 0:
        a = np.round(2.0 * a) / 2.0
    c = np.eye(outputs, states) if seed % 3 == 0 else rng.normal(size=(outputs, states))
    generators = 0.1 * rng.normal(size=(int(rng.integers(0, 3)), states))
    half = rng.choice([0.0, 0.5, 1.0], states)
    noise = float(rng.choice([0.0, 0.05, 0.5]))
    if seed >= 40:  # other units of the states
        units = 10.0 ** rng.integers(-9, 10, states)
        a = a * units[:, None] / units
        c = c / units
        generators = generators * units
        half = half * units
    observer = LinearObserver(
        a,
        c,
        Zonotope.box(-half, half),
        noise=noise,
        disturbance=Zonotope(np.zeros(states), generators),
    )
    x = rng.choice([-1.0, 1.0], states) * half
    true = []
    estimates = []
    for k in range(6):
        if k:
            observer.predict()
            x = a @ x + rng.choice([-1.0, 1.0], len(generators)) @ generators
        if rng.random() < 0.8:
            observer.update(c @ x + rng.choice([-1.0, 1.0], outputs) * noise)
        estimates.append(observer.estimate())
        true.append(x)
    for sets in (estimates, observer.smooth(estimates)):
        for estimate, state in zip(sets, true, strict=True):
            assert estimate.polytopes[0].contains(state), estimate.step


@pytest.mark.parametrize("seed", [0, 2, 4, 12, 15, 20, 126, 388, 475])
def test_true_state_is_inside_if_many_states_are_singular_or_flat(seed: int) -> None:
    """Formerly hulls of 700 points took minutes, and seed 388 was refused; thin sets became flat,
    without the true states of seeds 126 and 475.
    """
    from benchmarks.hard_observers import degenerate_case  # it imports this module

    observer, states, measured = degenerate_case(seed)
    for estimate, state in zip(observer.run(measured), states, strict=True):
        assert estimate.polytopes[0].contains(state)


def test_state_that_is_known_to_the_last_digit_does_not_change_the_others() -> None:
    """The third state converges until rounding makes its interval a point; formerly the set lost
    the true state.
    """
    box = Zonotope.box(-np.ones(3), np.ones(3))
    observer = LinearObserver(
        np.diag([1.0, 1.0, 1e-5]), np.eye(3), box, noise=1.0, offset=[0.0, 0.0, 1.0]
    )
    state = np.ones(3)
    for _ in range(8):
        observer.predict()
        state = np.diag([1.0, 1.0, 1e-5]) @ state + [0.0, 0.0, 1.0]
        estimate = observer.estimate()
        assert estimate.polytopes[0].contains(state), estimate.step
    np.testing.assert_allclose(estimate.lower[:2], -1.0, rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(estimate.upper[:2], 1.0, rtol=0.0, atol=1e-4)
    np.testing.assert_allclose(
        [estimate.lower[2], estimate.upper[2]], state[2], rtol=0.0, atol=1e-11
    )


# Interface
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("states", [2, 3])
def test_contradiction_is_located(states: int) -> None:
    c = np.eye(2, states)
    observer = LinearObserver(
        np.eye(states), c, Zonotope.box(-np.ones(states), np.ones(states)), noise=[0.25, 0.5]
    )
    estimates = observer.run([[0.5, 0.0], [0.5, 2.0], [0.0, 0.0]])
    assert [bool(estimate.is_empty) for estimate in estimates] == [False, True, True]
    where = observer.inconsistency
    assert [int(where.step), int(where.output)] == [1, 1]
    np.testing.assert_allclose(where.excess, 1.0)
    assert np.isnan(estimates[-1].lower).all()
    assert np.isnan(estimates[-1].chebyshev_centre()).all()
    assert observer.smooth(estimates)[0].is_empty


def test_matrices_of_each_step_are_used() -> None:
    a = np.array(PUBLISHED["A"])
    y = measurements()[:5]
    constant = published().run(y)
    observer = LinearObserver(
        np.repeat(a[None], 4, axis=0),
        np.repeat(np.array(PUBLISHED["C"])[None], 5, axis=0),
        Zonotope([0.0, 0.0], PUBLISHED["initial_generators"]),
        noise=0.2,
        disturbance=Zonotope([0.0, 0.0], PUBLISHED["disturbance_generators"]),
        offset=np.zeros((4, 2)),
    )
    estimates = observer.run(y)
    for ours, other in zip(estimates, constant, strict=True):
        np.testing.assert_array_equal(ours.polygons.polygon(), other.polygons.polygon())
    with pytest.raises(ValueError, match="state_matrix has 4 steps, none for step 4"):
        observer.predict()


@pytest.mark.parametrize("missing", [None, 0, 1])
def test_noise_in_a_polytope_keeps_its_projection_if_an_output_is_missing(
    missing: int | None,
) -> None:
    diamond = Polytope.from_vertices([[1.0, 0.0], [0.0, 0.5], [-1.0, 0.0], [0.0, -0.5]])
    observer = LinearObserver(
        np.eye(2), np.eye(2), Zonotope.box([-9.0, -9.0], [9.0, 9.0]), noise=diamond
    )
    y = np.array([1.0, 2.0])
    wanted = {None: 1.0, 0: 18.0, 1: 2.0 * 18.0}[missing]
    if missing is not None:
        y[missing] = np.nan
    observer.update(y)
    np.testing.assert_allclose(observer.estimate().polygons.area(), wanted)


# Noise, disturbances and cuts of single steps
# --------------------------------------------------------------------------------------------------


def drifting(states: int, **options: Any) -> LinearObserver:
    """Return an observer of a chain of integrators of some states, whose first one is measured."""
    a, c, generators = chain(1, states)
    box = Zonotope.box(-np.ones(states), np.ones(states))
    settings: dict[str, Any] = {"noise": 0.2, "disturbance": Zonotope(np.zeros(states), generators)}
    return LinearObserver(a, c, box, **(settings | options))


@pytest.mark.parametrize("states", [2, 3, 7])
def test_noise_and_disturbance_of_each_step_equal_their_boxes_and_sets(states: int) -> None:
    half = np.outer([0.0, 0.1, 0.3], np.ones(states))
    sets = [Zonotope.box(-row, row) for row in half]
    noise = np.array([[0.2], [0.4], [0.1], [0.3]])
    boxes = [Polytope.from_box(-row, row) for row in noise]
    y = [[0.1], [0.3], [0.2], [0.4]]

    one = drifting(states, noise=noise, disturbance=half)
    other = drifting(states, noise=boxes, disturbance=sets)
    by_cuts = drifting(states, noise=0.2, disturbance=None)
    results = [observer.run(y)[-1] for observer in (one, other)]
    for k, value in enumerate(y):
        if k:
            by_cuts.predict(disturbance=sets[k - 1])
        by_cuts.cut(np.eye(1, states), value[0] - noise[k], value[0] + noise[k])
    results.append(by_cuts.estimate())

    for estimate in results[1:]:
        np.testing.assert_allclose(estimate.lower, results[0].lower, rtol=0.0, atol=1e-7)
        np.testing.assert_allclose(estimate.upper, results[0].upper, rtol=0.0, atol=1e-7)
    with pytest.raises(ValueError, match="disturbance has 3 steps, none for step 3"):
        one.predict()


def test_sets_of_each_step_enter_the_exact_sum() -> None:
    observer = LinearObserver(
        np.eye(2),
        np.eye(2),
        Zonotope([0.0, 0.0], []),
        noise=9.0,
        disturbance=[[0.5, 0.0], [0.25, 2.0]],
    )
    observer.predict()
    observer.predict()
    np.testing.assert_allclose(observer.estimate().upper, [0.75, 2.0], rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("states", [2, 3, 7])
def test_smoothing_uses_the_disturbance_of_a_prediction(states: int) -> None:
    still = drifting(states, disturbance=None)
    estimates = [still.estimate()]
    still.predict(disturbance=Zonotope.box(np.zeros(states), 5.0 * np.eye(1, states)[0]))
    still.cut(np.eye(1, states), lower=3.0)
    estimates.append(still.estimate())

    smoothed = still.smooth(estimates)

    # x1 + 0.5 x2 + w is at least 3 for w of at most 5: all initial states are possible, and none
    # without w.
    np.testing.assert_allclose(smoothed[0].lower, -1.0, rtol=0.0, atol=1e-6)
    assert not smoothed[0].is_empty


@pytest.mark.parametrize("states", [2, 3, 7])
def test_cut_that_leaves_nothing_is_a_contradiction(states: int) -> None:
    observer = drifting(states)
    observer.cut([np.eye(states)[0], np.eye(states)[1]], [-np.inf, 1.5], np.inf)

    where = observer.inconsistency
    assert [int(where.step), int(where.output)] == [0, 1]
    np.testing.assert_allclose(where.excess, 0.5)
    with pytest.raises(ValueError, match="lower must have the shape"):
        observer.cut(np.eye(states), [0.0] * (states + 1))
    with pytest.raises(ValueError, match="normals must have the shape"):
        observer.cut([1.0], 0.0)


def test_cut_of_a_batch_has_ends_for_each_run() -> None:
    observer = drifting(2, runs=2)
    observer.cut([1.0, 0.0], upper=[[0.0], [0.5]])
    np.testing.assert_allclose(observer.estimate().upper[:, 0], [0.0, 0.5], rtol=0.0, atol=1e-14)


def test_none_is_a_missing_measurement() -> None:
    box = Zonotope.box(-np.ones(2), np.ones(2))
    settings: dict[str, Any] = {"noise": 0.1, "disturbance": Zonotope([0.0, 0.0], [[0.0, 0.1]])}
    rows = [[0.5, None], None, [None, 0.2]]
    with_nan = [[0.5, np.nan], [np.nan, np.nan], [np.nan, 0.2]]
    one, other = (
        LinearObserver(DRIFT, np.eye(2), box, **settings).run(y) for y in (rows, with_nan)
    )
    for ours, wanted in zip(one, other, strict=True):
        np.testing.assert_array_equal(ours.polygons.polygon(), wanted.polygons.polygon())
    single = LinearObserver(DRIFT, [[1.0, 0.0]], box, **settings)
    assert len(single.run([0.5, None, 0.6])) == 3
    single.update(None)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"noise": [[0.1, 0.2]]},
            r"noise must be half-widths of at least 0, a number or of shape \(1,\) or \(K, 1\)",
        ),
        ({"noise": [-0.1]}, "noise must be half-widths of at least 0"),
        (
            {"disturbance": [[0.1], [0.2]]},
            r"disturbance must be a set, or half-widths of at least 0 of shape \(3,\)",
        ),
        (
            {"disturbance": [Zonotope([0.0], []), Zonotope([0.0], [])]},
            "disturbance must have 3 coordinates",
        ),
    ],
)
def test_wrong_noise_or_disturbance_of_steps_is_refused(
    options: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        drifting(3, **options)


@pytest.mark.parametrize("states", [2, 3, 7])
def test_estimate_is_drawn_and_written(states: int) -> None:
    from matplotlib.figure import Figure

    observer = drifting(states)
    observer.update(0.9)
    estimate = observer.estimate()
    (artist,) = estimate.plot(Figure().subplots(), states=(1, 0), color="0.5")

    corners = artist.get_xy()
    # The set is a box: within 0.7 to 1 of x1 and within -1 to 1 of x2. Of 7 states the polygon is
    # around it.
    inner = np.array([[-1.0, 0.7], [1.0, 1.0]])
    around = 1e-6 if states < 7 else 0.01
    assert (corners.min(axis=0) <= inner[0] + 1e-9).all()
    assert (corners.min(axis=0) >= inner[0] - around).all()
    assert (corners.max(axis=0) <= inner[1] + around).all()
    written = estimate.to_dict()
    assert written["step"] == 0
    assert written["lower"] == estimate.lower.tolist()
    assert ("vertices" in written) == (states < 7)
    assert json.loads(json.dumps(written)) == written
    with pytest.raises(ValueError, match="two different numbers"):
        estimate.plot(states=(1, 1, 0))  # type: ignore[arg-type]


def test_batch_is_drawn_and_written_run_by_run() -> None:
    from matplotlib.figure import Figure

    observer = drifting(2, runs=3)
    observer.update([[0.9], [5.0], [0.5]])

    assert len(observer.estimate().plot(Figure().subplots())) == 2
    written = observer.estimate().to_dict()
    assert written["is_empty"] == [False, True, False]
    assert written["upper"][1] is None
    assert written["vertices"][1] == []


# The enlargement of a prediction
# --------------------------------------------------------------------------------------------------

coordinates = st.integers(-4, 4).map(float) | st.floats(-1.0, 1.0, width=32)


@settings(max_examples=100, deadline=None)
@given(
    st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=9),
    st.sampled_from([1e-3, 1.0, 40.0]),
)
def test_enlarged_polygon_contains_the_sum_with_the_box(
    points: list[tuple[float, float]], ratio: float
) -> None:
    polygon = ConvexPolygons.from_points(points).polygon()
    half = 2.0**-30, 2.0**-30 * ratio
    out = np.zeros((len(polygon) + 4, 2))
    count = enlarge(polygon, len(polygon), 0.0, 0.0, *half, out)
    ring = [(Fraction(x), Fraction(y)) for x, y in out[:count].tolist()]
    # Coordinates are rounded by much less than half a box.
    half_x, half_y = (Fraction(each) / 2 for each in half)
    corners = [
        (Fraction(x) + sign_x * half_x, Fraction(y) + sign_y * half_y)
        for x, y in polygon.tolist()
        for sign_x, sign_y in ((1, 1), (1, -1), (-1, 1), (-1, -1))
    ]
    assert hull([*ring, *corners]) == hull(ring)
    assert np.abs(out[:count].max(axis=0) - polygon.max(axis=0)).max() <= 6.0 * max(half)


def test_polygon_of_an_observer_gains_no_vertices_from_slack() -> None:
    out = np.zeros((12, 2))
    ring = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert enlarge(ring, 4, 0.0, 0.0, SUM_SLACK, SUM_SLACK, out) == 4


# A bounded number of facets
# --------------------------------------------------------------------------------------------------


def test_reduced_sets_contain_the_exact_ones_and_their_excess_widths_are_exact() -> None:
    a, c, generators = chain(2, 2)
    noise = np.full(2, 0.2)
    steps = 12
    size = 4
    rng = np.random.default_rng(6)
    states, _ = simulated(a, c, generators, noise, steps, rng)
    y = states @ c.T + rng.uniform(-0.15, 0.15, (steps, 2))
    start = Zonotope.box(-np.ones(size), np.ones(size))
    disturbance = Zonotope(np.zeros(size), generators)
    observer = LinearObserver(a, c, start, noise=noise, disturbance=disturbance, max_facets=20)
    estimates = observer.run(y)
    programs = Programs(a, c, generators, np.ones(size), noise, y)

    assert not estimates[0].reduced
    assert estimates[-1].reduced
    for estimate in (estimates[-1], *observer.smooth(estimates)[::4]):
        assert len(estimate.polytopes[0].normals) <= 20
        hull = np.array(programs.hull(estimate.step))
        assert (estimate.lower <= hull[0] + 1e-9).all()
        assert (estimate.upper >= hull[1] - 1e-9).all()

    last = estimates[-1]
    wider = last.upper - last.lower - np.ptp(np.array(programs.hull(steps - 1)), axis=0)
    np.testing.assert_allclose(estimates[-1].excess_widths(), wider, rtol=0.0, atol=1e-8)
    assert (estimates[0].excess_widths() == 0.0).all()


def test_number_is_accepted_for_one_output_and_malformed_bounds_are_refused() -> None:
    box = Zonotope.box([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0])
    observer = LinearObserver(
        np.eye(3), [[1.0, 0.0, 0.0]], box, noise=0.1, input_matrix=[[1.0], [0.0], [0.0]]
    )
    observer.update(0.5)
    observer.predict(1.0)
    np.testing.assert_allclose(
        [observer.estimate().lower[0], observer.estimate().upper[0]], [1.4, 1.6], atol=1e-9
    )
    with pytest.raises(ValueError, match="max_facets"):
        LinearObserver(np.eye(3), np.eye(3), box, noise=0.1, max_facets=5)
