"""`infoset adversary`: searches, files and table."""

from __future__ import annotations

from collections.abc import Iterator
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
    """Return the results of the searches in JSON."""
    lateral_m = {f"worst_miss_{axis}_m": value for axis, value in _lateral_m(chosen).items()}
    history = [
        {"evaluations": evaluations, "value_m": value_m} for evaluations, value_m in chosen.history
    ]
    return {
        "seed": chosen.seed,
        "strategy": chosen.strategy,
        "objective": chosen.objective.value,
        "searched_accelerations_m_s2": chosen.max_acceleration_m_s2,
        **worst.misses(),
        "worst_any_state_miss_m": chosen.any_state_miss_m,
        "worst_miss_m": chosen.miss_m,
        **lateral_m,
        "outcome": chosen.result.outcomes[0].value,
        "truth_kept": bool(chosen.result.truth_kept[0]),
        "evaluations": chosen.evaluations,
        "record": None if options.record is None else str(options.record),
        "found_from": chosen.construction,
        "changes": chosen.changes,
        "start": chosen.start(),
        "history": history,
    }


def _rows(scenario: Scenario, found: WorstEngagement) -> dict[str, str]:
    """Return the values of an engagement as text, by their titles."""
    axes = [*scenario.set_model.axes, "x"]
    position = ", ".join(axes)
    velocity = ", ".join(f"V_{axis}" for axis in axes)
    # The lateral axes are all but the last one, x.
    return {
        "maximum miss of any state of the set, m": number(found.any_state_miss_m),
        "miss of the simulated truth, m": number(found.miss_m),
        f"miss along {', '.join(axes[:-1])}, m": ", ".join(map(number, _lateral_m(found).values())),
        "outcome": found.result.outcomes[0].value,
        "true state always in the set": "yes" if found.result.truth_kept[0] else "no",
        f"initial {position}, km": _texts(found.result.position_m[0] / M_PER_KM),
        f"initial {velocity}, km/s": _texts(found.result.velocity_m_s[0] / M_PER_KM),
    }


def _lateral_m(found: WorstEngagement) -> dict[str, float]:
    """Return the position of the true state at the closest approach by lateral axis, m.

    It is from the spacecraft, without the aim point.
    """
    values_m = found.result.lateral_miss_m[0].tolist()
    return dict(zip(found.scenario.set_model.axes, values_m, strict=True))


def _texts(values: NDArray[np.float64]) -> str:
    return ", ".join(f"{value:.6g}" for value in values)


def _parts(
    scenario: Scenario, worst: WorstMisses, options: Adversary, elapsed_s: float
) -> Iterator[Part]:
    """Yield the table of the engagements found, and lines that explain it."""
    first = worst.engagements[0]
    # 1e-9 s, at most the resolution of the clock, keeps the rate finite.
    rate = worst.evaluations / max(elapsed_s, 1e-9)
    yield (
        f"{scenario_title(scenario)}, strategy {first.strategy}: "
        f"{worst.evaluations} simulated engagements, {number(rate)} per second"
    )

    columns = {"set never empty": worst.set_kept, "set also empty": worst.overall}
    if worst.set_kept is worst.overall:
        columns = {"set never empty, set also empty": worst.overall}
    table = number_table("", *columns)
    texts = [None if found is None else _rows(scenario, found) for found in columns.values()]
    for title in _rows(scenario, first):
        table.add_row(title, *(text[title] if text else "-" for text in texts))
    yield table

    target = "the target of the scenario"
    if first.max_acceleration_m_s2:
        bounds = ", ".join(
            f"{number(bound)} m/s^2 along {axis}"
            for axis, bound in first.max_acceleration_m_s2.items()
        )
        target = f"target accelerations up to {bounds}"
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

    if worst.sets_emptied:
        note = (
            f"the set became empty in {worst.sets_emptied} engagements of a search; their misses "
            "show a failure of the model"
        )
        if not scenario.set_model.is_guaranteed:
            note += "; use --model guaranteed, whose set keeps the true state"
        yield note
