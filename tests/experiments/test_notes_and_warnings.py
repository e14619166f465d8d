"""Messages, notes and warnings that keep an analyst from a wrong conclusion."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.experiments.interception.scenario_file import scenario_warnings
from infoset.experiments.interception.study import needed_notes, outlook_text
from infoset.guidance import Thruster
from infoset.sim import HitRequirement, estimate_hits
from infoset.sim.closed_form import possible_miss_of
from infoset.sim.requirement import Decision, judge, parse_requirement
from infoset.sim.scenario import of_model
from infoset.sim.schedule import image_times_s
from tests.experiments.command_line import Command


@pytest.mark.parametrize(
    ("thruster", "message"),
    [
        (
            {"last_impulse_s": 50.0, "delay_steps": 6},
            "excludes all impulses: .* 40 s before the nominal arrival",
        ),
        ({"last_impulse_s": 50.0, "impulses_s": (30.0, 20.0)}, "excludes all impulses"),
        ({"last_impulse_s": 500.0}, "excludes all impulses"),
        (
            {"impulses_s": (90.0,), "delay_steps": 2},
            "give later times or fewer delay_steps: got 90.0",
        ),
    ],
)
def test_a_schedule_without_impulses_names_the_key_to_change(
    thruster: dict[str, object], message: str
) -> None:
    engine = Thruster(10.0, 0.0, 1.0, **thruster)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=message):
        engine.impulse_steps(100.0, 10.0)


def test_an_image_window_between_two_images_has_the_nearest_two() -> None:
    scenario = load_scenario("dart-2022", ["camera.first_image_s=308", "camera.last_image_s=302"])
    assert image_times_s(scenario) == [310.0, 300.0]
    assert not scenario_warnings(scenario)


def test_images_before_the_start_have_a_warning() -> None:
    scenario = load_scenario(
        "dart-2022", ["camera.first_image_s=20000", "camera.last_image_s=14406"]
    )
    assert image_times_s(scenario) == []
    (line,) = scenario_warnings(scenario)
    assert (
        "no impulse follows a measurement: images are taken from 20000 s to 14406 s before" in line
    )


def test_a_nominal_arrival_that_is_far_too_late_is_checked_at_once() -> None:
    """Its steps are not searched: in floating point the time before the arrival does not change
    with the step.
    """
    scenario = load_scenario("dart-2022", ["nominal_range_m=1e50"])
    assert (
        "nominal_range_m is 1e+50 m, far outside uncertainty.x_m" in scenario_warnings(scenario)[-1]
    )


def test_closed_form_is_missing_for_a_camera_that_loses_images() -> None:
    scenario = load_scenario("dart-2022")
    lossy = replace(scenario.set_model.angle_sensor, miss_probability=0.5)
    with pytest.raises(ValueError, match="loses no image"):
        possible_miss_of(
            replace(scenario, **of_model(replace(scenario.set_model, angle_sensor=lossy)))
        )


LONG_STEPS = ("--set", "step_s=30", "--set", "camera.period_s=30")
"""A third of the steps of haiv-2013."""


@pytest.mark.usefixtures("unrendered")
def test_a_sweep_names_keys_without_an_effect_and_its_adversary(infoset: Command) -> None:
    pytest.importorskip("pyarrow")
    arguments = [
        "sweep",
        "haiv-2013",
        "--set",
        "thruster.impulses_s=[5400, 180]",
        "--noise",
        "game",
        "--runs",
        "6",
    ]
    arguments += [
        "--vary",
        "thruster.last_impulse_s=10:100:2",
        "--require",
        "miss_m p50<500",
        "--out",
        "out",
    ]
    _, out, _ = infoset(*arguments, *LONG_STEPS)
    assert (
        "thruster.last_impulse_s has no effect: cells that differ only in it have the same results"
        in out
    )
    assert "miss_m p50<500 is met against this adversary in " in out
    assert "game noise (tie rule upper) is one adversary, not the worst case: infoset bound" in out
    assert "one model of many" not in out
    notes = infoset.json("report", "out")["notes"]
    assert len(notes) == 2
    _, out, _ = infoset("report", "out", "--require", "impulse_m_s p50<100")
    assert "is met in " in out


@pytest.mark.parametrize(
    ("hits", "runs", "text"),
    [
        # 0.025^(1 / 100) = 0.9638; exact_p_value(100, 100, 0.94786) = 0.025
        (
            100,
            100,
            "the probability of a hit is at least 96.38 % if the number of runs was fixed before, "
            "94.79 % if runs were added after a look at results; hit>=0.99 needs about 435 more "
            "runs if all hit",
        ),
        # 0.99^367 > 0.025 >= 0.99^368
        (367, 367, "hit>=0.99 needs about 168 more runs if all hit"),
        (368, 368, "hit>=0.999 needs about 5005 more runs if all hit"),
        (98, 100, "more runs if the share of hits stays the same"),
        (99, 100, "hit>=0.99 needs more than 1000000 runs"),
    ],
)
def test_outlook_names_what_the_hits_show_and_the_runs_that_show_more(
    hits: int, runs: int, text: str
) -> None:
    assert text in outlook_text(estimate_hits(hits, runs))


def test_needed_runs_are_named_if_the_asked_ones_are_too_few() -> None:
    asked = HitRequirement(0.99)
    assert needed_notes(asked, 100) == [
        "hit>=0.99 needs at least 535 runs of each noise, if all hit (368 if the number is "
        "fixed before the first run); --runs gives 100"
    ]
    (decided,) = needed_notes(asked, 100, "--max-runs")
    assert decided.endswith("; --max-runs gives 100")
    assert needed_notes(asked, 534)
    assert needed_notes(asked, 535) == []
    (quantile,) = needed_notes(parse_requirement("miss_m p90<10"), 20)
    assert quantile.startswith(
        "miss_m p90<10 needs at least 51 runs of each noise, if all satisfy it (36 if "
    )


@pytest.mark.parametrize(("hits", "runs"), [(50, 100), (0, 10), (1900, 2000)])
def test_outlook_is_empty_if_the_sample_excludes_the_probability(hits: int, runs: int) -> None:
    assert outlook_text(estimate_hits(hits, runs)) == ""


def test_the_sweep_needs_the_runs_that_the_outlook_names() -> None:
    """The confidence sequence decides after the named number of hits, and not one run earlier."""
    outlook = outlook_text(estimate_hits(100, 100))
    needed = 100 + int(outlook.rpartition("needs about ")[2].split()[0])
    assert judge(np.ones(needed), HitRequirement(0.99), watched=True).decision is Decision.MET
    assert (
        judge(np.ones(needed - 1), HitRequirement(0.99), watched=True).decision
        is Decision.UNDECIDED
    )


def test_experiment_with_a_body_prints_the_outlook(infoset: Command, file: Path) -> None:
    code, out, error = infoset("experiment", file, "--runs", 4, "--set", "body.radius_m=1e5")
    assert code == 0
    assert "hit>=0.99 needs at least 535 runs of each noise" in error
    lines = out.splitlines()
    for case in ("random", "random + range sensor", "game", "game + range sensor"):
        (number,) = (at for at, line in enumerate(lines) if line.startswith(f"{case}: hit"))
        assert lines[number + 1].startswith(f"{case}: the probability of a hit is at least 39.76 %")
        assert lines[number + 1].endswith("hit>=0.99 needs about 531 more runs if all hit")

    _, out, error = infoset("experiment", file, "--runs", 4)
    assert "hit" not in out
    assert "hit" not in error


def test_the_word_needed_is_the_least_number_of_runs_of_each_noise(
    infoset: Command, file: Path
) -> None:
    """The requirement hit>=0.5 needs 8 hits: (n + 1) 0.5^(n + 1) / (1 - 0.5^(n + 1)) <= 0.025."""
    code, _, error = infoset(
        "sweep",
        file,
        "--set",
        "body.radius_m=1e5",
        "--vary",
        "thruster.max_impulse_m_s=2:8:2",
        "--require",
        "hit>=0.5",
        "--noise",
        "mixed",
        "--runs",
        "needed",
        "--out",
        "out",
    )
    assert code == 0
    assert "runs of each noise" not in error
    assert [
        (cell["runs"], cell["requirement"]) for cell in infoset.json("report", "out")["cells"]
    ] == [(8, "met")] * 4


@pytest.mark.parametrize("runs", ["0", "10000001", "many", "2.5"])
def test_a_number_of_runs_out_of_range_is_refused(infoset: Command, runs: str) -> None:
    message = infoset.refused("experiment", "--runs", runs)
    assert f'whole number from 1 to 10000000, or needed: got "{runs}"' in message


PAPERS_WORDS = re.compile(r"curve|figure-[234]|figure [234]|published|printed")


@pytest.mark.usefixtures("unrendered")
def test_words_of_the_paper_are_for_its_scenarios(
    infoset: Command, file: Path, tmp_path: Path
) -> None:
    own = "\n".join(
        [
            *infoset("experiment", file, "--runs", 2, "--out", "own")[1:],
            *infoset("engage", file, "--out", "flight", "--record", "a.npz")[1:],
            *infoset("adversary", file, "--budget", 20, "--out", "worst")[1:],
            *infoset("replay", "a.npz", "--out", "again")[1:],
        ]
    )
    names = [
        each.name
        for folder in ("own", "flight", "worst", "again")
        for each in (tmp_path / folder).iterdir()
    ]
    assert {"figure-distributions.png", "figure-process.png", "figure-sets.png"} <= set(names)
    assert not PAPERS_WORDS.search(own)
    assert not [name for name in names if PAPERS_WORDS.search(name)]
    assert "published_curve" not in (tmp_path / "own" / "results.csv").read_text()
    assert "published_curve" not in (tmp_path / "own" / "results.json").read_text()


@pytest.mark.usefixtures("unrendered")
def test_scenarios_of_the_paper_keep_its_words(infoset: Command, tmp_path: Path) -> None:
    _, out, err = infoset("experiment", "asteroid-1997-single", "--runs", 1, "--out", "curves")
    assert "curves 1 and 3 only" in err
    assert "curve 1: true state" in out
    assert (tmp_path / "curves" / "figure-4-distributions.png").exists()
    _, out, _ = infoset("engage", "asteroid-1997-single", "--out", "flight")
    assert re.search(r"impulse that the paper prints, m/s +244\.7\n", out)
    assert "docs/interception.md says which variants were tried" in out
    assert (tmp_path / "flight" / "figure-2-process.png").exists()


def test_printed_impulses_are_shown_for_the_two_noises_of_the_paper(infoset: Command) -> None:
    _, out, _ = infoset("engage", "asteroid-1997-single", "--noise", "both")
    assert re.search(r"impulse that the paper prints, m/s +244\.7 +521\.7\n", out)
    _, out, _ = infoset("engage", "asteroid-1997-single", "--noise", "gaussian")
    assert re.search(r"impulse that the paper prints, m/s +-\n", out)


def test_printed_impulses_are_shown_only_for_the_scenario_of_the_paper(
    infoset: Command, file: Path
) -> None:
    assert "the paper prints" not in infoset("engage", file)[1]
