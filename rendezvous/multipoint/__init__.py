"""Minimum-energy visits to several moving targets: flybys and rendezvous, their times and their order."""

from infoset.rendezvous.multipoint.kepler import KeplerTour
from infoset.rendezvous.multipoint.order import MAX_TARGETS, BestOrder, best_order, best_order_of_slots, best_times
from infoset.rendezvous.multipoint.segments import Nodes, NotSettledError, Path, solve_segments
from infoset.rendezvous.multipoint.times import BestTimes, Effort, TimeLimits, TimeSearch, optimise_times
from infoset.rendezvous.multipoint.tour import Meet, Target, Tour, Visits

__all__ = [
    "MAX_TARGETS",
    "BestOrder",
    "BestTimes",
    "Effort",
    "KeplerTour",
    "Meet",
    "Nodes",
    "NotSettledError",
    "Path",
    "Target",
    "TimeLimits",
    "TimeSearch",
    "Tour",
    "Visits",
    "best_order",
    "best_order_of_slots",
    "best_times",
    "optimise_times",
    "solve_segments",
]
