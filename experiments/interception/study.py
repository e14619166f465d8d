"""Studies of many runs: curves of an experiment, comparisons of strategies, lines about results."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.experiments.common.screen import some_runs
from infoset.experiments.common.units import length_text
from infoset.guidance import NoiseKind, Strategy, TieRule
from infoset.guidance.noise import NoiseSource
from infoset.guidance.noise_registry import noise_note
from infoset.model import Model, SetSettings
from infoset.sim import Body, HitEstimate, MissCause, Results, Scenario, estimate_hits
from infoset.sim.requirement import (
    MAX_RUNS_NEEDED,
    AnyRequirement,
    HitRequirement,
    least_runs,
    runs_needed,
    share_interval,
)
from infoset.sim.results import join
from infoset.sim.simulate import broken_assumption
from infoset.sim.statistics import shown_quantiles

QUANTILES = {"p10": 0.1, "p50": 0.5, "p90": 0.9, "p99": 0.99, "max": 1.0}
"""Levels of the quantiles in tables and JSON, by name."""


def summary(sample: Floats) -> dict[str, float | None]:
    """Return the quantiles of a sample by name; None if the sample is too small to show one."""
    return dict(zip(QUANTILES, shown_quantiles(sample, [*QUANTILES.values()]), strict=True))


WANTED_SHARES = tuple(1.0 - 10.0**-digits for digits in range(2, 8))
"""Probabilities of a hit that a study may have to show: 99 %, 99.9 %, ... 99.99999 %.

The last one allows one miss in ten million runs, the largest campaigns.
"""
USUAL_REQUIREMENT = HitRequirement(WANTED_SHARES[0])
"""Requirement whose runs `infoset experiment` and `infoset campaign` name before they begin."""
OF_PAPER = ("asteroid-1997", "asteroid-1997-single")
"""Scenarios of the paper of 1997; only their results have the numbers of its curves and figures."""


@dataclass(frozen=True)
class Curve:
    """Results with one noise, with or without the range sensor.

    The paper numbers its curves: 1 random noise, 2 random noise with range sensor, 3 game noise, 4
    game noise with range sensor. Curves 1 and 2 can have another noise.
    """

    number: int
    noise: str
    range_sensor: bool
    results: Results

    def title(self, scenario: Scenario) -> str:
        """Return the name of the curve: its number only for a scenario of the paper."""
        if is_of_paper(scenario):
            return f"curve {self.number}"
        return case_title(self.noise, self.range_sensor)


def is_of_paper(scenario: Scenario) -> bool:
    """Return whether a scenario is one of the paper's."""
    return scenario.name in OF_PAPER


def case_title(noise: str, range_sensor: bool) -> str:
    """Return the name of a case of the experiment: ``random``, ``game + range sensor``."""
    if range_sensor:
        return f"{noise} + range sensor"
    return noise


def curve_scenarios(
    scenario: Scenario, noise: NoiseKind = NoiseKind.RANDOM
) -> Sequence[tuple[int, Scenario]]:
    """Return number and scenario of each curve of the paper's figure 4.

    Without a range sensor there are only the curves 1 and 3.
    """
    numbered = (
        (1, replace(scenario, noise=noise, range_sensor=None)),
        (2, replace(scenario, noise=noise)),
        (3, replace(scenario, noise=NoiseKind.GAME, range_sensor=None)),
        (4, replace(scenario, noise=NoiseKind.GAME)),
    )
    return [
        (number, flown)
        for number, flown in numbered
        if scenario.range_sensor is not None or number in (1, 3)
    ]


@dataclass(frozen=True)
class Comparison:
    """Results of one strategy with one noise, by tie rule of the game noise.

    Another noise has one result, with the tie rule None.

    All strategies have the same runs.
    """

    strategy: str
    noise: str
    results: Mapping[TieRule | None, Results]

    @property
    def noise_title(self) -> str:
        """The noise in figures."""
        title = f"{self.noise} noise"
        if len(self.results) > 1:
            title += ", worst tie rule"
        return title

    def worst(self, column: str) -> Any:
        """Return a column of the results, of each run with its worst tie rule, shape (N,).

        `_WORST` declares which value of a column is the worst.
        """
        columns = [getattr(each, column) for each in self.results.values()]
        # `np.stack` would drop the masks.
        stack = np.ma.stack if np.ma.isMaskedArray(columns[0]) else np.stack
        return _WORST[column](stack(columns), axis=0)

    @property
    def hits(self) -> HitEstimate | None:
        """Runs that hit with every tie rule; None if the body has no size."""
        hit = self.worst("hit")
        if not hit.count():
            return None
        return estimate_hits(int(hit.sum()), len(hit))

    @property
    def missed(self) -> dict[str, Any]:
        """Number of misses by cause, of each run with its worst tie rule."""
        results = [*self.results.values()]
        worst = np.argmax([each.miss_m for each in results], axis=0)

        # The joined results contain all runs of the first tie rule, then all of the second, ...
        runs = len(results[0])
        return join(results).take(worst * runs + np.arange(runs)).missed


_WORST: Mapping[str, Callable[..., Any]] = {
    **dict.fromkeys(("miss_m", "impulse_m_s"), np.max),
    **dict.fromkeys(("truth_kept", "hit", "phi_held"), np.ma.all),
    "set_emptied": np.any,
}
"""Functions that return the worst value of each column."""
Compared = tuple[str, str, TieRule | None]
"""Strategy, noise and tie rule, None without game noise."""


def compared_scenarios(
    scenario: Scenario,
    strategies: Mapping[str, Strategy | None],
    noises: Mapping[str, NoiseSource | None],
) -> dict[Compared, Scenario]:
    """Return the scenarios of a comparison.

    Strategies and noises of Python files are not part of a scenario.
    """
    flown: dict[Compared, Scenario] = {}
    for name, own in strategies.items():
        guided = scenario
        if own is None:
            guided = replace(scenario, strategy=name)

        for noise, own_noise in noises.items():
            noisy = guided
            if own_noise is None:
                noisy = replace(guided, noise=NoiseKind(noise))

            if noise == NoiseKind.GAME.value:
                for tie in TieRule:
                    flown[name, noise, tie] = replace(noisy, tie=tie)
            else:
                flown[name, noise, None] = noisy

    return flown


def comparisons(flown: Mapping[Compared, Results]) -> list[Comparison]:
    """Return results by strategy and noise, in the order of the noises."""
    of_pair: dict[tuple[str, str], dict[TieRule | None, Results]] = {}
    for (name, noise, tie), results in flown.items():
        of_pair.setdefault((name, noise), {})[tie] = results
    return [Comparison(name, noise, results) for (name, noise), results in of_pair.items()]


@dataclass(frozen=True)
class SetCounts:
    """Numbers of runs by the history of their sets.

    All runs; runs with the true state inside the set at every step; runs whose set became empty;
    and runs whose set failed, that is, became empty or lost the true state.
    """

    runs: int = 0
    truth_kept: int = 0
    set_emptied: int = 0
    failed: int = 0

    def __add__(self, other: SetCounts) -> SetCounts:
        return SetCounts(
            self.runs + other.runs,
            self.truth_kept + other.truth_kept,
            self.set_emptied + other.set_emptied,
            self.failed + other.failed,
        )

    def __str__(self) -> str:
        every = some_runs(self.runs)
        kept_share = percent(self.truth_kept / self.runs)
        emptied_share = percent(self.set_emptied / self.runs)
        return (
            f"true state inside the set at every step: {self.truth_kept} of {every} "
            f"({kept_share}); set became empty: {self.set_emptied} of {every} ({emptied_share})"
        )


def set_counts(truth_kept: Flags, set_emptied: Flags) -> SetCounts:
    """Return the counts of N runs, from arrays of shape (N,)."""
    failed = ~truth_kept | set_emptied
    return SetCounts(
        len(truth_kept), int(truth_kept.sum()), int(set_emptied.sum()), int(failed.sum())
    )


def set_warnings(settings: SetSettings, counts: SetCounts) -> list[str]:
    """Return a warning if sets with these settings failed in some runs.

    The quantiles then also describe these failures of the model.
    """
    if not counts.failed:
        return []
    failures = (
        f"in {counts.failed} of {some_runs(counts.runs)} the set lost the true state or became "
        "empty"
    )
    if settings.model is Model.PAPER:
        return [
            f"warning: model paper: {failures}; the quantiles include these failures of the model; "
            "for quantiles without them, use --model guaranteed"
        ]

    return [
        f"warning: model guaranteed: {failures}, so an assumption of the model does not hold: "
        f"{broken_assumption(settings)}"
    ]


def scenario_title(scenario: Scenario) -> str:
    """Return the name of a scenario, with its range sensor and its model."""
    meter = "with" if scenario.range_sensor is not None else "without"
    return f"{scenario.name}, {meter} range sensor, model {scenario.information_set.model.value}"


def study_title(scenario: Scenario, strategy: str, seed: int) -> str:
    """Return the heading of a study: scenario, model, strategy and seed.

    A second line is the description of the scenario, if it has one.
    """
    head = f"{scenario_title(scenario)}, strategy {strategy}, seed {seed}"
    if not scenario.description:
        return head
    return f"{head}\n{scenario.description}"


def game_note(scenario: Scenario, rule: str | None = None) -> str:
    """Return a line that says how results with game noise are to be read.

    `rule` is the tie rule in words; None means the tie rule of the scenario.
    """
    note = (
        f"game noise ({rule or f'tie rule {scenario.tie.value}'}) is one adversary, not the worst "
        "case: infoset bound --budget 0 prints a miss, from the worst start, that no strategy can "
        "prevent"
    )
    if scenario.set_model.is_guaranteed:
        note += "; the miss of a run is at most its Phi, and other errors can give a greater Phi"
    if rule is None:
        note += "; infoset compare shows the worst of all tie rules"
    return note


def random_note(scenario: Scenario) -> str:
    """Return a line that says how results with random noise are to be read."""
    errors = "independent from one measurement to the next"
    if scenario.set_model.angle_sensor.has_constant_bias:
        errors += ", with a constant centroid error"
    return (
        f"random noise (uniform errors within the bounds, {errors}) is one model of many: a "
        "decision holds for it only"
    )


def noise_notes(scenario: Scenario, noises: Iterable[str], rule: str | None = None) -> list[str]:
    """Return a line for each noise that says how its results are to be read.

    `rule` is an argument of `game_note`.
    """
    notes = {kind.value: noise_note(kind, scenario) for kind in NoiseKind}
    notes[NoiseKind.GAME.value] = game_note(scenario, rule)
    return [note for noise in noises if (note := notes.get(noise)) is not None]


def hit_text(hits: HitEstimate | None, scenario: Scenario) -> str:
    """Return the share of hits with its interval; an empty text if the body has no size."""
    if hits is None or scenario.body is None:
        return ""
    interval = f"{percent(hits.lower)} to {percent(hits.upper)}"
    return (
        f"hit ({hit_meaning(scenario.body)}): {hits.hits} of {some_runs(hits.runs)} "
        f"({percent(hits.probability)}), 95 % CI {interval}"
    )


def hit_meaning(body: Body) -> str:
    """Return what counts as a hit: ``miss at most 75 m``."""
    if body.is_sphere_around_aim:
        return f"miss at most {body.inscribed_m:g} m"
    longer_m, shorter_m = body.axes_m
    if longer_m == shorter_m:
        return f"inside the disc of radius {longer_m:g} m"
    text = f"inside the ellipse of {longer_m:g} m x {shorter_m:g} m"
    if body.is_turned_by_chance:
        text += " in a direction that is drawn in each run"
    return text


def certain_hits_text(results: Results, scenario: Scenario) -> str:
    """Return in how many runs the hit was certain, and the mean probability of a hit of an ellipse
    in an unknown direction; an empty text if nothing is known of them.
    """
    texts = []
    if results.certain_hit is not None and (known := int(results.certain_hit.count())):
        texts.append(
            f"hit certain in flight (Phi at most {scenario.certain_radius_m:.4g} m): "
            f"{int(results.certain_hit.sum())} of {some_runs(known)}"
        )
    if results.hit_probability is not None:
        mean = float(results.hit_probability.mean())
        texts.append(
            f"mean probability of a hit for all directions of the ellipse: {percent(mean)}"
        )
    return "; ".join(texts)


def needed_notes(required: AnyRequirement, runs: int, option: str = "--runs") -> list[str]:
    """Return a line about the runs of a noise that a requirement needs; none if `runs` are enough.

    Runs are enough if they can decide also after looks at the results. `option` gives their number.
    """
    needed = least_runs(required.share, watched=True)
    if runs >= needed:
        return []
    all_runs = "if all hit"
    if not isinstance(required, HitRequirement) or required.cause is not None:
        all_runs = "if all satisfy it"
    fixed = least_runs(required.share, watched=False)
    return [
        f"{required} needs at least {needed} runs of each noise, {all_runs} ({fixed} if the number "
        f"is fixed before the first run); {option} gives {runs}"
    ]


def outlook_text(hits: HitEstimate | None) -> str:
    """Return a line about what the hits show, and the runs that would show more.

    The next probability is the first of 99 %, 99.9 % and so on that is greater than the lower end
    of the interval. The text is empty if it is greater than the upper end, too.
    """
    if hits is None:
        return ""
    # There is one: in no sample of at most ten million runs is the lower end above the last share.
    share = next(share for share in WANTED_SHARES if hits.lower < share)
    if hits.upper < share:
        return ""

    needed = runs_needed(hits.hits, hits.runs, share)
    if needed is None:
        more = f"needs more than {MAX_RUNS_NEEDED} runs"
    else:
        like = "all hit" if hits.hits == hits.runs else "the share of hits stays the same"
        more = f"needs about {needed - hits.runs} more runs if {like}"
    lower, _ = share_interval(hits.hits, hits.runs)
    return (
        f"the probability of a hit is at least {percent(hits.lower)} if the number of runs was "
        f"fixed before, {percent(lower)} if runs were added after a look at results; "
        f"{HitRequirement(share)} {more}"
    )


def miss_text(missed: Mapping[str, Any], runs: int, scenario: Scenario) -> str:
    """Return the numbers of misses by cause as text; an empty text without misses.

    The keys of `missed` are the causes (`infoset.sim.miss_cause`) and the lengths in the text.
    """
    count = sum(missed[cause.value] for cause in MissCause)
    if not count:
        return ""

    thruster = scenario.engine
    reasons = {
        MissCause.ENGINE: (
            "by the engine (it corrects {corrected_m}, the starts need up to {needed_m})"
        ),
        MissCause.BUDGET: f"by the budget of {thruster.budget_m_s:g} m/s",
        MissCause.KNOWLEDGE: (
            "by knowledge (at the last decision misses of +-{possible_m} are still possible)"
        ),
        MissCause.SATURATED: (
            f"saturated (known too late for impulses of {thruster.max_impulse_m_s:g} m/s)"
        ),
        MissCause.GUIDANCE: "by the guidance (to compare strategies: infoset compare)",
    }
    lengths = {
        name: length_text(value)
        for name, value in missed.items()
        if name.endswith("_m") and value is not None
    }
    parts = [
        f"{missed[cause.value]} {text.format(**lengths)}"
        for cause, text in reasons.items()
        if missed[cause.value]
    ]
    return f"missed {count} of {some_runs(runs)}: {', '.join(parts)}"


def redrawn_text(share: float | None) -> str:
    """Return the share of normal starts that were drawn again as text; empty for uniform starts."""
    if share is None:
        return ""
    return f"normal starts: {percent(share)} were outside the dispersion and drawn again"


def wrong_images_text(results: Results, scenario: Scenario) -> str:
    """Return in how many runs a wrong image is proved; an empty text if the set allows for none.

    If the set allows for one, the text also says in how many runs that image is named. If it allows
    for more, a single suspected image need not be the only wrong one, and none is named.
    """
    if results.wrong_image_proved_s is None or results.wrong_image_s is None:
        return ""
    text = (
        f"at most {some_wrong_images(scenario.information_set.wrong_images)} assumed; proved in "
        f"{results.wrong_image_proved_s.count()} of {some_runs(len(results))}"
    )
    if scenario.information_set.wrong_images == 1:
        text += f", named in {results.wrong_image_s.count()}"
    return text


def max_guarantee_m(results: Results) -> float | None:
    """Return the maximum guaranteed miss of runs, m.

    None if a run has no guarantee; in the model `paper` no run has one.
    """
    bounds = results.guaranteed_miss_m
    if not results.guarantees or np.ma.getmaskarray(bounds).any():
        return None
    return float(bounds.max())


def some_wrong_images(count: int) -> str:
    """Return a number of wrong images as text: 1 wrong image, 2 wrong images."""
    if count == 1:
        return "1 wrong image"
    return f"{count} wrong images"


def percent(share: float) -> str:
    """Return a share as a percentage with four digits, for example ``99.95 %``.

    Only the share 1 becomes ``100 %``: a share just below it has more digits.
    """
    text = f"{100.0 * share:.4g}"
    if text == "100" and share < 1.0:
        text = f"{100.0 * share:.12g}"
    return f"{text} %"
