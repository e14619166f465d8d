"""Scenarios in the guaranteed model."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from infoset import InitialSet, Model
from infoset.sim import Scenario


def guaranteed(scenario: Scenario, **settings: Any) -> Scenario:
    """Return a scenario in the guaranteed model that starts from the box, with settings of the set
    replaced.
    """
    changed = replace(
        scenario.information_set, model=Model.GUARANTEED, initial_set=InitialSet.BOX, **settings
    )
    return replace(scenario, information_set=changed)
