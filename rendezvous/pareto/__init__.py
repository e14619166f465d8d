"""Minimum-energy encounter of several craft, and the choice among its Pareto-optimal meetings."""

from infoset.rendezvous.pareto.bounded import (
    BoundedEncounter,
    NeededBound,
    bound_encounter,
    needed_bound,
)
from infoset.rendezvous.pareto.coalitions import Coalition, Coalitions, Core, analyse_coalitions
from infoset.rendezvous.pareto.encounter import Component, Craft, Encounter, Meeting
from infoset.rendezvous.pareto.front import distances, pareto_set, simplex_weights
from infoset.rendezvous.pareto.selections import min_sum_of_costs, minimax_excess, nearest_to
from infoset.rendezvous.pareto.solution import (
    CraftCost,
    EncounterSolution,
    Plan,
    solve_encounter,
    weighted_point,
)
from infoset.rendezvous.pareto.thrust import Flight, peak_control, total_impulse

__all__ = [
    "BoundedEncounter",
    "Coalition",
    "Coalitions",
    "Component",
    "Core",
    "Craft",
    "CraftCost",
    "Encounter",
    "EncounterSolution",
    "Flight",
    "Meeting",
    "NeededBound",
    "Plan",
    "analyse_coalitions",
    "bound_encounter",
    "distances",
    "min_sum_of_costs",
    "minimax_excess",
    "nearest_to",
    "needed_bound",
    "pareto_set",
    "peak_control",
    "simplex_weights",
    "solve_encounter",
    "total_impulse",
    "weighted_point",
]
