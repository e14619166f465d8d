"""`infoset adversary`: searches, files and table."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.screen import Part, figure_files, number, number_table, show
from infoset.experiments.common.units import M_PER_KM
from infoset.experiments.interception.command import Adversary
from infoset.experiments.interception.record_file import record_bytes
from infoset.experiments.interception.runs.engage import steps_csv
from infoset.experiments.interception.runs.engagement_table import (
    draw_engagements,
    engagement_figures,
)
from infoset.experiments.interception.runs.shared import WorstMisses, find_worst_misses, work_of
from infoset.experiments.interception.scenario_file import study_scenario
from infoset.experiments.interception.strategies import own_strategy
from infoset.experiments.interception.study import scenario_title
from infoset.sim import Scenario
from infoset.sim.adversary import Objective, WorstEngagement

RECORD = "record-worst.npz"


def run(options: Adversary) -> None:
    """Search, write the files and print the table."""
    scenario, notes = study_scenario(options)
    own = own_strategy(options.strategy)
    names = ("steps.csv", RECORD, *figure_files(*engagement_figures(scenario)))
    with work_of(options, scenario, names, {"--record": options.record}, notes) as work:
        worst = find_worst_misses(
            scenario,
            own,
            objective=Objective(options.objective),
            budget=options.budget,
            seed=options.seed,
            begin=work.begin,
        )
        elapsed_s = perf_counter() - work.began_s
        chosen = worst.overall
        if chosen is None:
            raise InputError(
                f"{scenario.name}: in every simulated engagement the miss was not finite; check "
                "the units of the scenario with: infoset scenarios check FILE"
            )
        work.save(_summary(worst, chosen, options))
        if options.record is not None or options.out is not None:
            record = chosen.record(own)
            work.written.save("steps.csv", steps_csv([record]))
            work.written.save(RECORD, record_bytes(record), "--record")
            draw_engagements([record], work.written, work.begin)
    show(_parts(scenario, worst, options, elapsed_s), options.quiet or work.written.stdout_taken)


def _summary(worst: WorstMisses, chosen: WorstEngagement, options: Adversary) -> dict[str, object]:
    return {
        "seed": chosen.seed,
        "strategy": chosen.strategy,
        "objective": chosen.objective.value,
        "searched_accelerations_m_s2": chosen.max_acceleration_m_s2,
        **worst.misses(),
        "worst_any_state_miss_m": chosen.any_state_miss_m,
        "worst_miss_m": chosen.miss_m,
        **{f"worst_miss_{axis}_m": value for axis, value in _lateral_m(chosen).items()},
        "outcome": chosen.result.outcomes[0].value,
        "truth_kept": bool(chosen.result.truth_kept[0]),
        "evaluations": chosen.evaluations,
        "record": None if options.record is None else str(options.record),
        "found_from": chosen.construction,
        "changes": chosen.changes,
        "start": chosen.start(),
        "history": [
            {"evaluations": evaluations, "value_m": value_m}
            for evaluations, value_m in chosen.history
        ],
    }


def _rows(scenario: Scenario) -> list[tuple[str, Callable[[WorstEngagement], str]]]:
    axes = [*scenario.set_model.axes, "x"]
    position = ", ".join(axes)
    velocity = ", ".join(f"V_{axis}" for axis in axes)
    return [
        ("maximum miss of any state of the set, m", lambda found: number(found.any_state_miss_m)),
        ("miss of the simulated truth, m", lambda found: number(found.miss_m)),
        (
            f"miss along {', '.join(axes[:-1])}, m",
            lambda found: ", ".join(map(number, _lateral_m(found).values())),
        ),
        ("outcome", lambda found: found.result.outcomes[0].value),
        (
            "true state always in the set",
            lambda found: "yes" if found.result.truth_kept[0] else "no",
        ),
        (f"initial {position}, km", lambda found: _texts(found.result.position_m[0] / M_PER_KM)),
        (
            f"initial {velocity}, km/s",
            lambda found: _texts(found.result.velocity_m_s[0] / M_PER_KM),
        ),
    ]


def _lateral_m(found: WorstEngagement) -> dict[str, float]:
    """Return the position of the true state at the closest approach by lateral axis, m."""
    return dict(
        zip(found.scenario.set_model.axes, found.result.lateral_miss_m[0].tolist(), strict=True)
    )


def _texts(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.6g}" for value in values)


def _parts(
    scenario: Scenario, worst: WorstMisses, options: Adversary, elapsed_s: float
) -> Iterator[Part]:
    first = worst.engagements[0]
    is_same = worst.set_kept is worst.overall
    columns = {"set never empty, set also empty" if is_same else "set never empty": worst.set_kept}
    if not is_same:
        columns["set also empty"] = worst.overall
    table = number_table("", *columns)
    for title, text in _rows(scenario):
        table.add_row(title, *("-" if found is None else text(found) for found in columns.values()))
    count = sum(found.evaluations for found in worst.engagements)
    yield (
        f"{scenario_title(scenario)}, strategy {first.strategy}: "
        f"{count} simulated engagements, {number(count / max(elapsed_s, 1e-9))} per second"
    )
    yield table
    bounds = [
        f"{number(bound)} m/s^2 along {axis}" for axis, bound in first.max_acceleration_m_s2.items()
    ]
    target = (
        f"target accelerations up to {', '.join(bounds)}"
        if bounds
        else "the target of the scenario"
    )
    yield (
        f"searched: starts in the uncertainty, errors within their bounds, {target}; objective: "
        f"{options.objective}"
    )
    yield (
        "any state of the set: maximum miss of a state that a section contained when control "
        "ended for it; the sections contain at least all states that agree with the measurements"
    )
    yield (
        "simulated truth: the strategy cannot guarantee a smaller miss, and greater misses may "
        "exist"
    )
    if not is_same:
        emptied = max(found.sets_emptied for found in worst.engagements)
        yield (
            (
                f"the set became empty in {emptied} engagements of a search; these misses show a "
                "failure of the model"
            )
            + (
                ""
                if scenario.set_model.is_guaranteed
                else "; use --model guaranteed, whose set keeps the true state"
            )
        )
