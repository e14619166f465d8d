"""`infoset bound`: computation, files and tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset.experiments.common.screen import (
    Part,
    RowByRow,
    figure_files,
    number,
    number_table,
    parts_of,
    show,
)
from infoset.experiments.common.units import M_PER_KM
from infoset.experiments.interception.command import Bound
from infoset.experiments.interception.runs.shared import (
    Progress,
    WorstMisses,
    find_worst_misses,
    need_finite,
    work_of,
)
from infoset.experiments.interception.scenario_file import study_scenario
from infoset.experiments.interception.strategies import chosen_strategies
from infoset.experiments.interception.study import max_guarantee_m, some_wrong_images
from infoset.guidance import Strategy
from infoset.model import StateBox
from infoset.sensors import Camera
from infoset.sim import Body, Record, Results, Scenario
from infoset.sim.bound.game_value import ValueReserve, value_reserve, why_no_value
from infoset.sim.bound.lower_bound import LowerBound, lower_bound, pair_at
from infoset.sim.bound.pair_flight import PairFlight, fly_pair
from infoset.sim.bound.pair_of_motions import TruthPair
from infoset.sim.results import join

FIGURE = "figure-bound"
STRATEGY_TITLES = (
    "strategy",
    "pairs\n\nm",
    "set never\nempty\nm",
    "also\nempty\nm",
    "miss /\nbound\n",
    "guaranteed\n\nm",
)


@dataclass(frozen=True)
class WorstOfStrategy:
    """Simulations of one strategy: the pairs of the bound, and the worst engagements found."""

    name: str
    flights: tuple[tuple[TruthPair, PairFlight], ...]
    searched: WorstMisses
    records: tuple[Record, ...]

    @property
    def results(self) -> Results:
        """Results of all simulations."""
        of_pairs = [flight.results for _, flight in self.flights]
        return join([*of_pairs, *(record.result for record in self.records)])

    @property
    def pairs_m(self) -> float:
        """Maximum miss of the pairs, m."""
        return max(float(flight.results.miss_m.max()) for _, flight in self.flights)

    @property
    def worst_m(self) -> float:
        """Maximum miss of all simulations, m."""
        return float(self.results.miss_m.max())

    @property
    def set_kept_m(self) -> float | None:
        """Maximum miss with the set never empty, m; None without such an engagement."""
        results = self.results
        return max(results.miss_m[~results.set_emptied].tolist(), default=None)

    def over(self, lower: LowerBound) -> float | None:
        """Return the maximum miss with the set never empty, divided by the bound.

        None if there is no such miss, or the bound is zero.
        """
        if self.set_kept_m is None or lower.bound_m <= 0.0:
            return None
        return self.set_kept_m / lower.bound_m


def run(options: Bound) -> None:
    """Compute the bound, simulate the strategies, write the files and print the tables."""
    scenario, notes = study_scenario(options)
    strategies: Mapping[str, Strategy | None] = {}
    if options.budget > 0 or options.strategies is not None:
        strategies = chosen_strategies(scenario, options.strategies)

    with work_of(options, scenario, figure_files(FIGURE), notes=notes) as work:
        # The bound is printed at once, before the strategies are simulated.
        lower = lower_bound(scenario, progress=work.begin("lower bound"))
        nominal = _nominal(scenario)
        exact_m = lower.bound_m
        if scenario.set_model.wrong_images:
            begun = work.begin("lower bound without wrong images")
            exact_m = lower_bound(_without_wrong_images(scenario), progress=begun).bound_m
        quiet = options.quiet or work.written.stdout_taken
        show(_bound_parts(scenario, lower, exact_m, nominal), quiet)

        progress = work.begin("strategies")
        worst = _worst_of_strategies(scenario, lower, strategies, options, progress, quiet)
        value = _value(scenario, lower)
        best = _best(worst)
        summary = _summary(scenario, lower, exact_m, nominal, worst)
        work.save({**summary, "value": _value_json(lower, value, best)})
        if options.out is not None:
            from infoset.experiments.interception.figures.bound import draw_bound

            worst_m = {strategy.name: strategy.worst_m for strategy in worst}
            work.written.figure(FIGURE, draw_bound(scenario, lower, worst_m))

    show(
        [
            *_value_lines(lower.bound_m, value, best),
            *_notes(scenario, lower, options, worst),
        ],
        quiet,
    )


def _worst_of_strategies(
    scenario: Scenario,
    lower: LowerBound,
    strategies: Mapping[str, Strategy | None],
    options: Bound,
    progress: Progress,
    quiet: bool,
) -> list[WorstOfStrategy]:
    """Simulate the strategies one after another, and print the row of each when it ends."""
    if not strategies:
        return []
    rows = RowByRow(STRATEGY_TITLES, strategies, quiet)
    reports = parts_of(progress, len(strategies))
    worst = []

    for (name, own), report in zip(strategies.items(), reports, strict=True):
        strategy = _simulate(scenario, lower, name, own, options, report)
        values = [
            strategy.pairs_m,
            *strategy.searched.misses().values(),
            strategy.over(lower),
            max_guarantee_m(strategy.results),
        ]
        rows.add(name, *map(number, values))
        worst.append(strategy)

    show([""], quiet)
    return worst


def _simulate(
    scenario: Scenario,
    lower: LowerBound,
    name: str,
    own: Strategy | None,
    options: Bound,
    report: Progress,
) -> WorstOfStrategy:
    """Simulate a strategy against the pairs of the bound, and search for its worst engagements."""
    flown = scenario
    if own is None:
        flown = replace(scenario, strategy=name)
    flights = [(pair, fly_pair(flown, pair, own)) for pair in lower.pairs]
    for _, flight in flights:
        need_finite(flight.results)

    searched = WorstMisses(None, None)
    if options.budget > 0:
        # One or two searches report to the same bar.
        searched = find_worst_misses(
            flown, own, budget=options.budget, seed=options.seed, begin=lambda _name: report
        )
    report(1.0)
    records = tuple(engagement.record(own) for engagement in searched.engagements)
    return WorstOfStrategy(name, tuple(flights), searched, records)


def _without_wrong_images(scenario: Scenario) -> Scenario:
    settings = replace(scenario.information_set, wrong_images=0, image_classes=None)
    return replace(scenario, information_set=settings)


def _nominal(scenario: Scenario) -> TruthPair:
    """Return the best pair at the nominal range and closing speed.

    If these are outside the uncertainty, its nearest values are taken.
    """
    box = scenario.set_model.bounds
    label_m = float(np.clip(scenario.nominal_range_m, *box.x_m))
    # vx_m_s is negative in an approach, and the closing speed positive.
    vx_m_s = float(np.clip(-scenario.set_model.closing_speed_m_s, *box.vx_m_s))
    return pair_at(scenario, label_m, vx_m_s)


def _summary(
    scenario: Scenario,
    lower: LowerBound,
    exact_m: float,
    nominal: TruthPair,
    worst: Sequence[WorstOfStrategy],
) -> dict[str, object]:
    """Return the bound, its pairs and the strategies in JSON.

    `exact_m` is the bound without wrong images.
    """
    model = scenario.set_model
    keys: dict[str, object] = {
        "disturbance_m_s2": {axis: model.axis(axis).disturbance_m_s2 for axis in model.axes},
        "wrong_images": model.wrong_images,
        "lower_bound_m": lower.bound_m,
        "lower_bound_without_wrong_images_m": exact_m,
    }
    if scenario.body is not None:
        keys["hit_cannot_be_guaranteed"] = lower.bound_m > scenario.body.certain_miss_m
    keys["reached_at"] = _where(lower.pair, scenario)
    keys["at_nominal_range"] = {**_where(nominal, scenario), "bound_m": nominal.bound_m}
    keys["by_label"] = [
        {
            "label_m": label.label_m,
            "closing_speed_m_s": -label.vx_m_s,
            "last_common_step": label.last_common_step,
            "bound_m": label.bound_m,
        }
        for label in lower.by_label
    ]
    keys["strategies"] = [_strategy_json(strategy, lower, scenario) for strategy in worst]
    return keys


def _strategy_json(
    strategy: WorstOfStrategy, lower: LowerBound, scenario: Scenario
) -> dict[str, object]:
    results = strategy.results
    flights = [
        {
            **_where(pair, scenario),
            "bound_m": pair.bound_m,
            "miss_m": flight.results.miss_m.tolist(),
            **_by_axis("miss", flight.results.lateral_miss_m.T, scenario),
            "impulse_m_s": flight.results.impulse_m_s.tolist(),
            "outcomes": [outcome.value for outcome in flight.results.outcomes],
            "truth_kept": flight.results.truth_kept.tolist(),
        }
        for pair, flight in strategy.flights
    ]

    return {
        "name": strategy.name,
        "worst_found_m": strategy.worst_m,
        "worst_found_set_kept_m": strategy.set_kept_m,
        "guaranteed_m": max_guarantee_m(results),
        "worst_over_bound": strategy.over(lower),
        "outcome": results.outcomes[int(results.miss_m.argmax())].value,
        "worst_of_pairs_m": strategy.pairs_m,
        **strategy.searched.misses(),
        "flights": flights,
    }


def _where(pair: TruthPair, scenario: Scenario) -> dict[str, object]:
    """Return in JSON where and how long the motions of a pair are alike.

    The closing speed is positive, and `vx_m_s` negative.
    """
    return {
        "label_m": pair.label_m,
        "closing_speed_m_s": -pair.vx_m_s,
        "motions": 1 if pair.is_single else 2,
        "last_common_step": pair.last_common_step,
        "alike_until_before_arrival_s": _equal_until_s(pair, scenario),
        "wrong_images_before_arrival_s": [
            _before_arrival_s(pair, steps, scenario).tolist() for steps in pair.wrong_steps
        ],
        # The last time is that of the arrival at x = 0 without impulses.
        **_by_axis("apart", np.abs(pair.difference_m[:, -1]), scenario),
    }


def _by_axis(quantity: str, values_m: NDArray[np.float64], scenario: Scenario) -> dict[str, object]:
    """Return values by lateral axis, m, with the names of their keys."""
    return {
        f"{quantity}_{axis}_m": values_m[index].tolist()
        for index, axis in enumerate(scenario.set_model.axes)
    }


def _equal_until_s(pair: TruthPair, scenario: Scenario) -> float:
    """Return the time from the last equal measurement to arrival, s.

    Without an equal measurement it is one step more than the flight; for a single motion, whose
    measurements are all equal, the time from the last step.
    """
    return pair.arrival_s - pair.last_common_step * scenario.set_model.step_s


def _before_arrival_s(
    pair: TruthPair, steps: NDArray[np.int64], scenario: Scenario
) -> NDArray[np.float64]:
    return np.asarray(pair.arrival_s - steps * scenario.set_model.step_s)


class _GameValue(NamedTuple):
    """The reserve up to which the bound is the value of the game; None if it is not proved.

    `reasons` say why it is not proved, and are empty otherwise.
    """

    reserve: ValueReserve | None
    reasons: Sequence[str]


def _value(scenario: Scenario, lower: LowerBound) -> _GameValue:
    """Return how much greater than the bound the value of the game can be."""
    reasons = why_no_value(scenario)
    if reasons:
        return _GameValue(None, reasons)
    reserve = value_reserve(scenario, lower)
    if isinstance(reserve, str):
        return _GameValue(None, [reserve])
    return _GameValue(reserve, [])


def _value_json(
    lower: LowerBound, value: _GameValue, best: WorstOfStrategy | None
) -> dict[str, object]:
    keys: dict[str, object] = {"at_least_m": lower.bound_m, "at_most_m": None, "reserve_m": None}
    if value.reserve is not None:
        keys["at_most_m"] = lower.bound_m + value.reserve.total_m
        reserve_m = {"total": value.reserve.total_m}
        for name, part in asdict(value.reserve).items():
            reserve_m[name.removesuffix("_m")] = part
        keys["reserve_m"] = reserve_m
    keys["not_proved_because"] = list(value.reasons)
    keys["best_strategy"] = best and best.name
    keys["best_strategy_worst_found_m"] = best and best.worst_m
    return keys


def _best(worst: Sequence[WorstOfStrategy]) -> WorstOfStrategy | None:
    """Return the strategy whose maximum miss found is smallest; None without a search."""
    searched = [strategy for strategy in worst if strategy.searched.engagements]
    return min(searched, key=lambda strategy: strategy.worst_m, default=None)


def _value_lines(lower_m: float, value: _GameValue, best: WorstOfStrategy | None) -> Iterator[str]:
    reserve = value.reserve
    if reserve is not None:
        parts = ", ".join(
            f"{name.removesuffix('_m').replace('_', ' ')} {number(part)}"
            for name, part in asdict(reserve).items()
        )
        yield (
            f"the bound is the value of the game up to a reserve of {number(reserve.total_m)} m: "
            f"no strategy guarantees less than {number(lower_m)} m, and symmetric-miss guarantees "
            "at most the reserve more"
        )
        yield f"reserve, m: {parts}"
        return

    line = f"the value of the game is at least {number(lower_m)} m"
    if best is not None:
        line += f"; minimum of the maximum misses found: {number(best.worst_m)} m, of {best.name}"
    yield line
    yield f"no upper end is proved, because of: {', '.join(value.reasons)}"


def _bound_parts(
    scenario: Scenario, lower: LowerBound, exact_m: float, nominal: TruthPair
) -> Iterator[Part]:
    """Yield the bound, its pairs by closing speed, and the bound at the nominal range."""
    model = scenario.set_model
    bound_m = number(lower.bound_m)
    line = (
        f"{scenario.name}, model {model.model.value}: no strategy can guarantee a miss below "
        f"{bound_m} m for all starts in [uncertainty]"
    )
    if model.wrong_images:
        line += (
            f" with {some_wrong_images(model.wrong_images)} in a flight ({number(exact_m)} m "
            "without wrong images)"
        )
    yield line
    if scenario.body is not None:
        yield _body_line(scenario.body, lower.bound_m)
    if _starts_nearer(scenario):
        yield (
            "the simulated runs start in [dispersion], which is narrower: their misses can be "
            "smaller"
        )
    yield from _attitude_lines(scenario)
    which = "the nominal ones"
    if (nominal.label_m, nominal.vx_m_s) != (scenario.nominal_range_m, -model.closing_speed_m_s):
        which = "the nearest to the nominal ones in [uncertainty]"
    yield (
        f"at the range {nominal.label_m / M_PER_KM:.1f} km and closing speed "
        f"{-nominal.vx_m_s / M_PER_KM:g} km/s, {which}: {number(nominal.bound_m)} m"
    )
    for axis in model.axes:
        maximum = model.axis(axis).disturbance_m_s2
        yield f"acceleration of the object along {axis} in these pairs: at most {maximum:.3g} m/s^2"

    bounds = number_table(
        "closing speed\nkm/s",
        "bound\nm",
        "range at t = 0\nkm",
        "equal measurements until\ns before arrival",
    )

    for pair in lower.pairs:
        equal_until = "one motion"
        if not pair.is_single:
            equal_until = f"{_equal_until_s(pair, scenario):.2f}"
        bounds.add_row(
            f"{-pair.vx_m_s / M_PER_KM:g}",
            number(pair.bound_m),
            f"{pair.label_m / M_PER_KM:.1f}",
            equal_until,
        )

    yield bounds
    yield from _wrong_image_lines(scenario, lower.pair)
    yield ""


def _body_line(body: Body, bound_m: float) -> str:
    """Return whether a strategy can guarantee a hit of the body, as far as the bound says it."""
    far = f"{body.certain_miss_m:.4g} m"
    text = f"the body, which extends up to {far} from the aim point"
    far_text = f"it extends at most {far} from the aim point"
    if body.is_turned_by_chance:
        text = f"the body in all directions of the ellipse, up to {far} from the aim point"
        far_text = f"a miss of more than {far} does not hit in all directions of the ellipse"

    near = f"the body: a miss of at most {body.inscribed_m:.4g} m hits"
    if body.is_sphere_around_aim:
        near = f"the body of radius {body.inscribed_m:g} m"

    if bound_m <= body.inscribed_m:
        return f"this does not exclude a strategy that guarantees a hit of {near}"
    if bound_m <= body.certain_miss_m:
        return f"no statement about a hit: a miss of {number(bound_m)} m can hit {text}"
    if body.is_sphere_around_aim:
        return f"a hit of {near} cannot be guaranteed by any strategy"
    return f"a hit of the body cannot be guaranteed by any strategy: {far_text}"


def _starts_nearer(scenario: Scenario) -> bool:
    """Whether the uncertainty extends beyond the dispersion, from which simulated runs start."""
    for field in fields(StateBox):
        known = getattr(scenario.uncertainty, field.name)
        true = getattr(scenario.dispersion, field.name)
        if known is not None and (known[0] < true[0] or true[1] < known[1]):
            return True
    return False


def _attitude_lines(scenario: Scenario) -> Iterator[str]:
    """Yield lines about the errors of the attitude of a camera."""
    sensor = scenario.bearing_sensor
    if sensor.misalignment_rad > 0.0:
        yield (
            "the misalignment of the camera is left out: the bound is that of an aligned camera, "
            "and a misaligned one can only make it greater"
        )
    if isinstance(sensor, Camera) and sensor.drift_rad > 0.0:
        yield (
            "the drift of the camera is an error like that of the pixel: it may change from image "
            "to image; of a drift that changes slowly nothing is proved"
        )


def _wrong_image_lines(scenario: Scenario, pair: TruthPair) -> Iterator[str]:
    """Yield a line about the images that are wrong in one of the two motions of a pair."""
    first, second = (_before_arrival_s(pair, steps, scenario) for steps in pair.wrong_steps)
    if not len(first):
        return
    in_first, in_second = (", ".join(f"{time:.2f}" for time in each) for each in (first, second))
    yield (
        f"wrong images of the first pair, s before arrival: {in_first} in one motion, "
        f"{in_second} in the other"
    )


def _notes(
    scenario: Scenario, lower: LowerBound, options: Bound, worst: Sequence[WorstOfStrategy]
) -> Iterator[str]:
    """Yield lines that explain the tables."""
    if any(strategy.results.set_emptied.any() for strategy in worst):
        note = (
            "in some engagements a measurement contradicted all states of the set, which became "
            "empty"
        )
        if not scenario.set_model.is_guaranteed:
            note += "; try --model guaranteed"
        yield note

    if any(pair.is_single for pair in lower.pairs):
        yield (
            "one motion: a start that all impulses together do not bring to the target, whatever "
            "is measured"
        )
    if not worst:
        return

    yield "pairs: maximum miss of the states that prove the bound"
    search = "not searched"
    if options.budget:
        search = (
            "maximum misses found by `infoset adversary --objective fixed-truth --budget "
            f"{options.budget}`"
        )
    yield f"set never empty, also empty: {search}"
    yield (
        "miss / bound: maximum miss of pairs and search, without sets that became empty, divided "
        "by the bound"
    )
    yield "guaranteed: maximum bound Phi on the miss, computed during these engagements"
