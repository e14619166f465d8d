"""The simulator: scenarios, true motion, closed loop, records, campaigns, bounds and statistics."""

from infoset.sim.adversary import NothingCountsError, Objective, WorstEngagement, find_worst
from infoset.sim.body import Body
from infoset.sim.bound.lower_bound import LowerBound, lower_bound
from infoset.sim.campaign import Campaign, RunsUntil
from infoset.sim.closed_form import possible_miss_of
from infoset.sim.covariance import Covariance
from infoset.sim.miss_cause import MissCause
from infoset.sim.parallel import CampaignNoise
from infoset.sim.record import Record, RecordedInconsistency, fly_one
from infoset.sim.requirement import HitRequirement, Requirement
from infoset.sim.results import GuaranteeWarning, Outcome, Results
from infoset.sim.scenario import Manoeuvre, Scenario, Sun, Target
from infoset.sim.simulate import simulate
from infoset.sim.statistics import (
    Distribution,
    HitEstimate,
    QuantileEstimate,
    empirical_distribution,
    estimate_hits,
    estimate_quantiles,
)
from infoset.sim.stopping_rule import QuantileName, StoppingRule
from infoset.sim.storage import Axis
from infoset.sim.wrong_images import WrongImages, WrongRanges

__all__ = [
    "Axis",
    "Body",
    "Campaign",
    "CampaignNoise",
    "Covariance",
    "Distribution",
    "GuaranteeWarning",
    "HitEstimate",
    "HitRequirement",
    "LowerBound",
    "Manoeuvre",
    "MissCause",
    "NothingCountsError",
    "Objective",
    "Outcome",
    "QuantileEstimate",
    "QuantileName",
    "Record",
    "RecordedInconsistency",
    "Requirement",
    "Results",
    "RunsUntil",
    "Scenario",
    "StoppingRule",
    "Sun",
    "Target",
    "WorstEngagement",
    "WrongImages",
    "WrongRanges",
    "empirical_distribution",
    "estimate_hits",
    "estimate_quantiles",
    "find_worst",
    "fly_one",
    "lower_bound",
    "possible_miss_of",
    "simulate",
]
