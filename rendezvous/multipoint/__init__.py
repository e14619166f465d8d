"""Minimum-energy visits to several moving targets: flybys and rendezvous, times and order."""

from infoset.rendezvous.multipoint.bounded import bound_path, bound_visits, needed_bound
from infoset.rendezvous.multipoint.kepler import KeplerTour
from infoset.rendezvous.multipoint.order import (
    MAX_TARGETS,
    BestOrder,
    OrderSearch,
    best_order,
    best_order_of_slots,
    best_times,
)
from infoset.rendezvous.multipoint.segments import Nodes, NotSettledError, Path, solve_segments
from infoset.rendezvous.multipoint.time_grid import Candidate, GridSearch, search_grid
from infoset.rendezvous.multipoint.times import (
    BestTimes,
    Effort,
    Grid,
    TimeLimits,
    TimeSearch,
    optimise_times,
)
from infoset.rendezvous.multipoint.tour import Meet, Tour, TourTarget, Visits

__all__ = [
    "MAX_TARGETS",
    "BestOrder",
    "BestTimes",
    "Candidate",
    "Effort",
    "Grid",
    "GridSearch",
    "KeplerTour",
    "Meet",
    "Nodes",
    "NotSettledError",
    "OrderSearch",
    "Path",
    "TimeLimits",
    "TimeSearch",
    "Tour",
    "TourTarget",
    "Visits",
    "best_order",
    "best_order_of_slots",
    "best_times",
    "bound_path",
    "bound_visits",
    "needed_bound",
    "optimise_times",
    "search_grid",
    "solve_segments",
]
