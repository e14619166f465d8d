"""The guaranteed model keeps the true state and the bound Phi for all errors within the bounds."""

from __future__ import annotations

import importlib
import itertools
from dataclasses import replace
from types import ModuleType

import numpy as np
import pytest

from infoset import InformationSet, InformationSetView, InitialSet, Model, RateSensor, StateBox
from infoset.arrays import Floats
from infoset.engine.section_law import section_laws
from infoset.guidance import LineOfSight, NoiseKind, RandomNoise
from infoset.sim import Manoeuvre, Outcome, Results, Scenario, Sun, Target, simulate
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.gravity import on_board_model, with_gravity
from infoset.sim.kepler import KeplerMotion
from infoset.sim.scenario import of_model
from infoset.sim.target import acceleration_m_s2


def script(name: str) -> ModuleType:
    """A benchmark script: its engagements are flown here too, fewer of them."""
    pytest.importorskip("benchmarks", reason="benchmarks are in a checkout only")
    return importlib.import_module(f"benchmarks.{name}")


@pytest.fixture(scope="module")
def soundness() -> ModuleType:
    return script("soundness")


@pytest.mark.parametrize("budget", [24, pytest.param(600, marks=pytest.mark.thorough)])
def test_phi_is_nearly_reached_by_an_exact_section(asteroid: Scenario, budget: int) -> None:
    """In the flights with the greatest Phi of a search, up to 3 % above 200 sections of the labels
    of each step.
    """
    great_phi = script("great_phi")
    scenario = great_phi.guaranteed(replace(asteroid, range_sensor=None), "least-effort")
    for phi_m, exact_m, miss_m in great_phi.great_flights(scenario, budget, seed=0, shown=1):
        assert miss_m < exact_m <= phi_m <= 1.03 * exact_m


def guaranteed(scenario: Scenario) -> Scenario:
    model = replace(scenario.set_model, model=Model.GUARANTEED, initial_set=InitialSet.BOX)
    return replace(scenario, **of_model(model), dispersion=model.bounds)


def median(values: np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]) -> float:
    return float(np.median(values.compressed()))


def sound(results: Results) -> bool:
    held = results.phi_held
    return bool(results.truth_kept.all() and held.all() and not held.mask.any())


@pytest.mark.parametrize(
    ("hostile", "batches", "batch"),
    [
        (False, 4, 32),
        (True, 4, 32),
        *(pytest.param(each, 32, 80, marks=pytest.mark.thorough) for each in (False, True)),
    ],
)
def test_nothing_breaks_the_guarantee(
    soundness: ModuleType, hostile: bool, batches: int, batch: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every noise, from anywhere in B x D, every eighth batch of the comet; benchmarks/soundness.py
    flies 200 000.
    """
    monkeypatch.setattr(soundness, "BATCH", batch)
    total = soundness.Count()
    engagements = batches * batch
    for number in range(batches):
        total += soundness.fly_batch(number, hostile, seed=2)
    assert vars(total) == {
        "engagements": engagements,
        "outside": 0,
        "lost": 0,
        "above": 0,
        "unknown": 0,
        "refused": 0,
    }


@pytest.mark.parametrize("batches", [12, pytest.param(60, marks=pytest.mark.thorough)])
def test_nothing_breaks_the_guarantee_of_a_camera(
    soundness: ModuleType, batches: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Random scenarios, two thirds in space, with every noise; benchmarks/soundness.py flies 24
    000.
    """
    monkeypatch.setattr(soundness, "BATCH", 16)
    total = soundness.Count()
    for number in range(batches):
        total += soundness.fly_camera_batch(number, seed=3)
    assert vars(total) == {
        "engagements": 16 * batches,
        "outside": 0,
        "lost": 0,
        "above": 0,
        "unknown": 0,
        "refused": 0,
    }


@pytest.mark.thorough
def test_broken_assumptions_are_detected(soundness: ModuleType, asteroid: Scenario) -> None:
    """A target that manoeuvres harder than its bound, and a truth faster than D, are caught."""
    scenario = guaranteed(asteroid)
    harder = replace(scenario, target=Target(Manoeuvre.BANG_BANG, 0.5, switching_period_s=5.0))
    assert soundness.fly(harder, 0, 80, 2).outside > 0
    faster = replace(scenario, dispersion=replace(scenario.dispersion, vx_m_s=(-61e3, -60e3)))
    assert soundness.fly(faster, 0, 80, 2).outside > 0


@pytest.fixture(scope="module")
def two_hundred(asteroid: Scenario) -> Results:
    """Two hundred flights of the guaranteed model under random noise, without a rate sensor."""
    return simulate(guaranteed(asteroid), 200)


@pytest.fixture(scope="module")
def hundred(two_hundred: Results) -> Results:
    """The first hundred of them: a flight does not depend on the others of its batch."""
    return two_hundred.take(np.arange(100))


def test_phi_is_tight(asteroid: Scenario, two_hundred: Results) -> None:
    """Phi has the medians of the theory: 13 m for random noise and 15 to 17.5 m for game noise."""
    game = simulate(replace(guaranteed(asteroid), noise=NoiseKind.GAME), 200)
    for results, minimum, maximum in ((two_hundred, 12.0, 14.5), (game, 14.0, 17.5)):
        assert sound(results)
        assert minimum <= median(results.guaranteed_miss_m) <= maximum


def test_bound_of_gravity_equals_the_derived_formula(asteroid: Scenario) -> None:
    model = on_board_model(guaranteed(asteroid))
    plain = 1.5 * 1.324948e20 / 150e9**3 * 6301.3e3
    assert plain == pytest.approx(3.71e-7, rel=0.01)
    # On top of that: the impulses' way across, and units that change as gravity changes V_x
    # (docs/guarantee.md).
    speed = 100.0 + 1000.0
    closing = 57e3
    turned = (2.0 * speed + 10e3 * (2.0 / 3.0) * 59e3 / 6301.3e3) / closing / 1.5
    assert plain * (1.0 + turned) < model.gravity_m_s2 < plain * (1.0 + turned) * 1.01
    assert on_board_model(replace(asteroid, sun=None)).gravity_m_s2 == 0.0


@pytest.mark.parametrize("speed_m_s", [150.0, 1e3, 5.8e4])
def test_gravity_moves_the_model_motion_within_its_bounds(
    asteroid: Scenario, speed_m_s: float
) -> None:
    """The truth at its label's scale, e (T - t) z/x, flown without the set: its first V, and its
    acceleration.
    """
    x_m = 1e6
    vz_m_s = 0.003 * speed_m_s
    e = speed_m_s
    step_s = x_m / e / 100.0
    widths = (1e3, 3e5, 1e6)  # of the start's z, in m; what starts in any of them is flown at once
    plain = []
    for z_m in widths:
        box = StateBox(
            (-z_m, z_m), (x_m, 1.01 * x_m), (-vz_m_s, vz_m_s), (-1.000001 * e, -0.999999 * e)
        )
        model = guaranteed(asteroid).set_model
        sensor = replace(model.angle_sensor, period_s=step_s)
        slow = replace(model, closing_speed_m_s=e, step_s=step_s, angle_sensor=sensor, bounds=box)
        plain.append(replace(slow, disturbance_m_s2=0.0))
    start = np.array(
        [
            [z, x_m, vz, -e]
            for z_m in widths
            for z, vz in itertools.product((-z_m, z_m), (-vz_m_s, vz_m_s))
        ]
    )
    maximum = np.zeros(len(widths))
    for direction in np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False):
        sun = Sun(1.324948e20, 150e9, float(direction))
        motion = KeplerMotion(start[:, :2], start[:, 2:], sun)
        arrival_s = motion.arrival_s()
        first = motion.sight()
        label_v = e * arrival_s * first.slope_rate_per_s - e * first.slope
        z_label = []
        for step in range(80):
            z_label.append(e * (arrival_s - step * step_s) * motion.sight().slope)
            motion.advance(step_s)
        acceleration = np.abs(np.diff(z_label, n=2, axis=0))[:, 0] / step_s**2
        for case, z_m in enumerate(widths):
            model = with_gravity(plain[case], sun, 0.0)
            (law,) = section_laws(model)
            mine = slice(4 * case, 4 * case + 4)
            assert (law.vz_min <= label_v[0, mine]).all()
            assert (label_v[0, mine] <= law.vz_max).all()
            most = float(acceleration[:, mine].max())
            rounding = 4.0 * np.spacing(z_m + vz_m_s * 100.0 * step_s) / step_s**2
            assert most <= model.acceleration_m_s2 + rounding
            maximum[case] = max(maximum[case], most / model.acceleration_m_s2)
    assert (maximum > 0.25).all()  # the bound is not lavish, and what it bounds was there


@pytest.mark.parametrize("runs", [4, pytest.param(100, marks=pytest.mark.thorough)])
def test_a_rate_sensor_helps_and_stays_sound(
    asteroid: Scenario, hundred: Results, runs: int
) -> None:
    sensor = RateSensor(period_s=1.0, error_rad_s=1e-6)
    scenario = replace(guaranteed(asteroid), rate_sensor=sensor)
    for noise in NoiseKind.RANDOM, NoiseKind.GAME:
        results = simulate(replace(scenario, noise=noise), runs)
        assert sound(results)
        if noise is NoiseKind.RANDOM:
            without = hundred.take(np.arange(runs))
            assert (results.guaranteed_miss_m < without.guaranteed_miss_m).all()
            assert median(results.guaranteed_miss_m) < 0.9 * median(without.guaranteed_miss_m)


def test_targets_manoeuvre_within_their_bound() -> None:
    draws = np.random.default_rng(0).uniform(-1.0, 1.0, size=(1, 400, 400))
    miss = np.where(np.arange(400) % 2, 3.0, -3.0)
    flown = {
        kind: np.stack(
            [
                acceleration_m_s2(Target(kind, 0.02, 10.0), draws, step, 0.5, miss)
                for step in range(400)
            ]
        )
        for kind in Manoeuvre
    }
    assert (flown[Manoeuvre.NONE] == 0.0).all()
    for kind, accelerations in flown.items():
        assert kind is Manoeuvre.NONE or (np.abs(accelerations) == 0.02).all()
    switches = {
        kind: (np.diff(np.sign(each), axis=0) != 0).sum(axis=0) for kind, each in flown.items()
    }
    assert (switches[Manoeuvre.CONSTANT] == 0).all()
    assert (switches[Manoeuvre.BANG_BANG] == 19).all()
    # A Poisson process of one switch in 10 s, seen each half second over 199.5 s: (1 - exp(-0.1))/2
    # an interval.
    assert switches[Manoeuvre.RANDOM_TELEGRAPH].mean() == pytest.approx(
        399 * 0.5 * (1 - np.exp(-0.1)), rel=0.03
    )
    assert (np.sign(flown[Manoeuvre.WORST_CASE]) == np.sign(miss)).all()


class Faulty:
    """Random noise through a sensor that breaks its bound."""

    def __init__(self, inner: RandomNoise, fault: str) -> None:
        self._inner = inner
        self._fault = fault
        self._stuck: Floats | None = None

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Floats]:
        measured = dict(self._inner.measure(sight, predicted))
        bound = sight.sensors["angle"].bound(sight)
        honest = measured["angle"]
        if self._fault == "outlier" and sight.step == 100:
            measured["angle"] = sight.alpha_rad + 5.0 * bound
        elif self._fault == "bias":
            measured["angle"] = honest + 1.5 * bound
        elif self._fault == "stuck" and 60 <= sight.step < 120:
            self._stuck = honest if self._stuck is None else self._stuck
            measured["angle"] = self._stuck
        elif self._fault == "dropout" and 80 <= sight.step < 86:
            del measured["angle"]
        return measured


@pytest.mark.parametrize("model", [Model.PAPER, Model.GUARANTEED])
@pytest.mark.parametrize("fault", ["none", "outlier", "bias", "stuck", "dropout"])
@pytest.mark.parametrize("meter", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_faulty_sensors_are_reported_and_guidance_continues(
    asteroid: Scenario, ranging: Scenario, model: Model, fault: str, meter: bool
) -> None:
    scenario = ranging if meter else asteroid
    if model is Model.GUARANTEED:
        box = replace(scenario.set_model, model=model, initial_set=InitialSet.BOX)
        scenario = replace(scenario, **of_model(box))
    draws = draw(scenario, range(30), 0)
    flight = Engagements(scenario, draws, noise=Faulty(RandomNoise(draws.errors), fault))
    while flight.flying:
        flight.advance()
    results = flight.results(np.arange(30))
    assert np.isfinite(results.miss_m).all()
    lost = np.array([outcome is Outcome.SET_EMPTY for outcome in results.outcomes])
    if fault == "outlier":
        assert lost.all()
        step, label = flight.inconsistency
        assert (step == 100).all()
        assert ((label > 5e6) & (label < 6.5e6)).all()
        assert results.phi_held.count() == 0
        # One measurement lost, and one measurement's error of width: hardly worse than without the
        # fault.
        assert np.median(results.miss_m) < 2.5
    if fault in ("none", "dropout") and model is Model.GUARANTEED:
        assert not lost.any()
        assert sound(results)
    if fault == "bias":
        # Broken for good: nothing can be promised, but it is told, and flown to the end.
        assert not results.truth_kept.any()
        assert (results.miss_m < 5e3).all()
    else:
        assert np.median(results.miss_m) < 5.0


def test_phi_follows_impulses_fired_after_labels_have_left(asteroid: Scenario) -> None:
    """With a distant threshold labels leave eighty steps before they arrive.

    The impulses in these steps still count.
    """
    early = guaranteed(replace(asteroid, noise=NoiseKind.GAME))
    early = replace(early, **of_model(replace(early.set_model, range_threshold_m=2.4e6)))
    assert sound(simulate(early, 100))


def test_rectangle_is_refused_because_it_does_not_contain_the_starts(asteroid: Scenario) -> None:
    """At range x the rectangle ends at x arctan(z/x), below z: the start with the maximum z is
    outside.
    """
    settings = guaranteed(asteroid).information_set
    with pytest.raises(ValueError, match=r'^initial_set = "rectangle" belongs to model = "paper"'):
        replace(settings, initial_set=InitialSet.RECTANGLE)
    with pytest.raises(ValueError, match=r'^initial_set = "rectangle" belongs to model = "paper"'):
        replace(guaranteed(asteroid).set_model, initial_set=InitialSet.RECTANGLE)

    published = replace(asteroid.set_model, model=Model.PAPER, initial_set=InitialSet.RECTANGLE)
    box = published.bounds
    for section in InformationSet(published).sections():
        heights_m = section.polygons[0].polygon()[:, 1]
        assert heights_m.max() < box.z_m[1]
