"""Minimum-energy encounter of several craft, and the choice among its Pareto-optimal meetings."""

from infoset.rendezvous.pareto.coalitions import Coalition, Coalitions, Core, analyse_coalitions
from infoset.rendezvous.pareto.encounter import Component, Craft, Encounter, Meeting
from infoset.rendezvous.pareto.feasibility import (
    BoundCheck,
    Feasibility,
    check_bound,
    min_peak,
    peak_control,
    total_impulse,
)
from infoset.rendezvous.pareto.front import distances, pareto_set, simplex_weights
from infoset.rendezvous.pareto.selections import min_sum_of_costs, minimax_excess, nearest_to
from infoset.rendezvous.pareto.solution import (
    CraftCost,
    EncounterSolution,
    Plan,
    solve_encounter,
    weighted_point,
)

__all__ = [
    "BoundCheck",
    "Coalition",
    "Coalitions",
    "Component",
    "Core",
    "Craft",
    "CraftCost",
    "Encounter",
    "EncounterSolution",
    "Feasibility",
    "Meeting",
    "Plan",
    "analyse_coalitions",
    "check_bound",
    "distances",
    "min_peak",
    "min_sum_of_costs",
    "minimax_excess",
    "nearest_to",
    "pareto_set",
    "peak_control",
    "simplex_weights",
    "solve_encounter",
    "total_impulse",
    "weighted_point",
]
