"""Lower bounds of the miss, with flights of their motions: `python -m benchmarks.bound_numbers`.

Built-in scenarios: the bound, its processor time, and the pairs of the command flown with all
strategies: the minimum of miss by bound, which is at least 1, and the maximum error in units of its
bound, which is at most 1.

Gravity, for docs/guarantee-bound.md: 2 km/s with the Sun at 60 million km across the approach, an
image each 200 s with 5 urad and 5 m, a start within 10 km of the x axis, and impulses of at most 2
m/s until 2000 s before the arrival. 2 G T^2 is the change of the closing speed by gravity, as a
share. Far start: the approach of 1997 from z = 8 to 10 km with known range and speed and impulses
of at most 0.5 m/s.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import replace

from infoset import Camera, InitialSet, Model, SetModel, StateBox
from infoset.experiments import load_scenario
from infoset.experiments.interception.scenario_file import with_model
from infoset.guidance import Thruster, make_strategy, strategy_names
from infoset.sim import Scenario, Sun
from infoset.sim.bound.lower_bound import LowerBound, lower_bound
from infoset.sim.bound.pair_flight import fly_pair
from infoset.sim.scenario import of_model

BUILT_IN = (
    "asteroid-1997",
    "asteroid-1997-space",
    "dart-2022",
    "haiv-2013",
    "comet-fast",
    "deep-impact-2005",
)
RANGES_KM = (60e3, 140e3, 190e3, 200e3, 300e3, 400e3)
SUN = Sun(1.324948e20, 60e9, 0.5 * math.pi)


def slow(range_km: float) -> Scenario:
    """Return the slow approach from a range."""
    range_m = 1e3 * range_km
    box = StateBox(
        (-1e4, 1e4), (range_m - 500.0, range_m + 500.0), (-0.1, 0.1), (-2000.01, -1999.99)
    )
    sensor = Camera(200.0, 5e-6, 5.0)
    model = SetModel(
        2e3,
        200.0,
        box,
        sensor,
        range_threshold_m=1e5,
        model=Model.GUARANTEED,
        initial_set=InitialSet.BOX,
    )
    thruster = Thruster(30.0, 1e-4, 2.0, last_impulse_s=2000.0)
    return Scenario(
        name="slow",
        description="",
        sun=SUN,
        nominal_range_m=range_m,
        dispersion=box,
        **of_model(model),
        range_sensor=None,
        thruster=thruster,
    )


def far() -> Scenario:
    """Return the approach of 1997 from a far start with a weak engine."""
    published = load_scenario("asteroid-1997")
    box = StateBox((8e3, 10e3), (5801.3e3, 5801.3e3), (0.0, 0.0), (-58e3, -58e3))
    model = replace(
        published.set_model, bounds=box, model=Model.GUARANTEED, initial_set=InitialSet.BOX
    )
    thruster = replace(published.thruster, max_impulse_m_s=0.5)
    return replace(published, sun=None, dispersion=box, **of_model(model), thruster=thruster)


def flown(scenario: Scenario, lower: LowerBound) -> tuple[float, float]:
    """Return the minimum miss by bound of the pairs with all strategies, and the maximum error of a
    common image.
    """
    over = math.inf
    errors = 0.0
    for name in strategy_names():
        for pair in lower.pairs:
            flight = fly_pair(scenario, pair, make_strategy(name))
            over = min(over, float(flight.results.miss_m.max()) / pair.bound_m)
            errors = max(errors, flight.max_error_share)
    return over, errors


def main() -> None:
    """Compute and print."""
    for name in BUILT_IN:
        scenario = with_model(load_scenario(name), Model.GUARANTEED)
        begun_s = time.process_time()
        lower = lower_bound(scenario)
        taken_s = time.process_time() - begun_s
        over, errors = flown(scenario, lower)
        sys.stdout.write(
            f"{name:20} bound {lower.bound_m:.6f} m in {taken_s:5.2f} s   "
            f"miss / bound {over:.7f}   error {errors:.7f}\n"
        )
        sys.stdout.flush()
    for range_km in RANGES_KM:
        scenario = slow(range_km)
        change = (
            2.0
            * SUN.gravitational_parameter_m3_s2
            / SUN.distance_m**3
            * scenario.nominal_arrival_s**2
        )
        found = lower_bound(scenario)
        free = lower_bound(replace(scenario, sun=None))
        sys.stdout.write(
            f"{range_km:8.0f} km   2 G T^2 {change:6.2%}   bound {found.bound_m:6.2f} m   reserve "
            f"{found.pair.reserve_m:.3f} m   without gravity {free.bound_m:6.2f} m\n"
        )
    found = lower_bound(far())
    motions = "one motion" if found.pair.is_single else "two motions"
    sys.stdout.write(f"far start: bound {found.bound_m:.1f} m, by {motions}\n")


if __name__ == "__main__":
    main()
