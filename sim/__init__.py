"""The simulator: scenarios, true motion, closed loop, records, campaigns, bounds and statistics."""

from sim.adversary import NothingCountsError, Objective, WorstEngagement, find_worst
from sim.bound.linear_program import BoundError
from sim.bound.lower_bound import LowerBound, lower_bound
from sim.campaign import Campaign
from sim.closed_form import possible_miss_of
from sim.covariance import Covariance
from sim.miss_cause import MissCause
from sim.parallel import CampaignNoise
from sim.record import Inconsistency, Record, fly_one
from sim.requirement import HitRequirement, Requirement
from sim.results import GuaranteeWarning, Outcome, Results
from sim.scenario import Body, Manoeuvre, Scenario, Sun, Target
from sim.simulate import simulate
from sim.statistics import (
    Distribution,
    HitEstimate,
    QuantileEstimate,
    empirical_distribution,
    estimate_hits,
    estimate_quantiles,
)
from sim.stopping_rule import QuantileName, StoppingRule
from sim.storage import Axis

__all__ = [
    "Axis",
    "Body",
    "BoundError",
    "Campaign",
    "CampaignNoise",
    "Covariance",
    "Distribution",
    "GuaranteeWarning",
    "HitEstimate",
    "HitRequirement",
    "Inconsistency",
    "LowerBound",
    "Manoeuvre",
    "MissCause",
    "NothingCountsError",
    "Objective",
    "Outcome",
    "QuantileEstimate",
    "QuantileName",
    "Record",
    "Requirement",
    "Results",
    "Scenario",
    "StoppingRule",
    "Sun",
    "Target",
    "WorstEngagement",
    "empirical_distribution",
    "estimate_hits",
    "estimate_quantiles",
    "find_worst",
    "fly_one",
    "lower_bound",
    "possible_miss_of",
    "simulate",
]
