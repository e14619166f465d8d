"""The simulator: scenarios, the truth, the closed loop, records and statistics."""

from sim.campaign import Campaign, CampaignResult, Sweep
from sim.chunk import CampaignNoise
from sim.record import Inconsistency, Record, StepRecord, fly_one
from sim.results import Outcome, Results
from sim.scenario import Manoeuvre, Scenario, Sun, Target
from sim.simulate import simulate
from sim.statistics import (
    Distribution,
    QuantileEstimate,
    band_half_width,
    empirical_distribution,
    estimate_quantiles,
    quantiles,
)
from sim.stopping_rule import QuantileName, Requirement, StoppingRule

__all__ = [
    "Campaign",
    "CampaignNoise",
    "CampaignResult",
    "Distribution",
    "Inconsistency",
    "Manoeuvre",
    "Outcome",
    "QuantileEstimate",
    "QuantileName",
    "Record",
    "Requirement",
    "Results",
    "Scenario",
    "StepRecord",
    "StoppingRule",
    "Sun",
    "Sweep",
    "Target",
    "band_half_width",
    "empirical_distribution",
    "estimate_quantiles",
    "fly_one",
    "quantiles",
    "simulate",
]
