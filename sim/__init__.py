"""The simulator: scenarios, the truth, the closed loop, records and statistics."""

from sim.record import Inconsistency, Record, StepRecord, fly_one
from sim.results import Outcome, Results
from sim.scenario import Manoeuvre, Scenario, Sun, Target
from sim.simulate import simulate
from sim.statistics import Distribution, band_half_width, empirical_distribution, quantiles

__all__ = [
    "Distribution",
    "Inconsistency",
    "Manoeuvre",
    "Outcome",
    "Record",
    "Results",
    "Scenario",
    "StepRecord",
    "Sun",
    "Target",
    "band_half_width",
    "empirical_distribution",
    "fly_one",
    "quantiles",
    "simulate",
]
