"""Titles of engagements in figures and pages."""

from __future__ import annotations

from collections.abc import Sequence

from infoset import Convention
from sim import Outcome, Record, Scenario
from sim.adversary import WORST_FOUND
from sim.results import ending

_OUTCOMES = {Outcome.SET_EMPTY: "set empty", Outcome.BUDGET_SPENT: "budget spent", Outcome.DIVERGED: "diverged"}


def noise_title(record: Record) -> str:
    """Return the title of the noise of an engagement: `random noise`, or `game noise, range meter`."""
    name = "worst errors found" if record.noise == WORST_FOUND else f"{record.noise_name} noise"
    return name + (", range meter" if record.scenario.range_sensor is not None else "")


def record_titles(records: Sequence[Record]) -> list[str]:
    """Return a title for each record; equal noises are distinguished by run, seed, strategy, model, tie or scenario."""
    titles = [noise_title(record) for record in records]
    candidates = (
        [f"run {record.run}" for record in records],
        [f"seed {record.seed}" for record in records],
        [record.strategy for record in records],
        [f"{record.scenario.set_model.kind.value} model" for record in records],
        [f"tie {record.scenario.tie.value}" for record in records],
        [record.scenario.name for record in records],
    )
    for extra in candidates:
        if len(set(titles)) < len(titles) and len(set(extra)) > 1:
            titles = [f"{title}, {more}" for title, more in zip(titles, extra, strict=True)]
    if len(records) == 1:
        return titles
    return [f"({chr(ord('a') + index)}) {title}" for index, title in enumerate(titles)]


def angle_name(scenario: Scenario, axis: str) -> str:
    """Return the name of the angle of an axis: a gimbal measures azimuth and elevation."""
    if scenario.set_model.angle_sensor.convention is Convention.GIMBAL:
        return {"y": "azimuth α", "z": "elevation α"}[axis]
    return "line-of-sight angle α"


def outcome_title(record: Record) -> str:
    """Return miss and impulse, the outcome if it is not the arrival, and `hit` or `missed` if the body has a size."""
    result = record.result
    text = f"miss {_shown(float(result.miss_m[0]))} m, impulse spent {float(result.impulse_m_s[0]):.1f} m/s"
    outcome = _OUTCOMES.get(result.outcomes[0])
    return ending(text if outcome is None else f"{text}, {outcome}", result.hit.tolist()[0])


def _shown(metres: float) -> str:
    return f"{metres:.2f}" if metres < 100.0 else f"{metres:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}")
