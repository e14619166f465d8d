from __future__ import annotations

import itertools
import json
import math
import re
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.campaigns.samples import Sample
from experiments.campaigns.sweep_axes import key_label, sweep_axes, sweep_cells, unit_of
from experiments.campaigns.sweep_figures import draw_sweep, requirement_words
from experiments.campaigns.sweep_table import (
    SHOWN,
    Limit,
    SweepTable,
    answer,
    answers,
    limits,
    spans_decades,
    sweep_table,
)
from experiments.common.figure_style import INK
from experiments.common.input_file import to_toml
from experiments.interception.scenario_file import load_scenario
from experiments.interception.study import SetCounts
from guidance import NoiseKind
from sim import (
    Body,
    Campaign,
    CampaignNoise,
    QuantileEstimate,
    QuantileName,
    Requirement,
    Scenario,
    estimate_hits,
    simulate,
)
from sim.requirement import Decision, HitRequirement, Verdict, judge, parse_requirement, share_interval
from sim.scenario import of_model
from sim.storage import Axis, CampaignFolder, read_manifest
from sim.storage.codec import fingerprint
from tests.experiments.campaigns.figure_room import need_room

pytestmark = pytest.mark.usefixtures("unrendered")

Infoset = Callable[..., tuple[int, str, str]]
FILES = [
    *(".lock", "figure-sweep.pdf", "figure-sweep.png", "manifest.json", "scenario.toml", "shards", "summary.json"),
    "sweep.parquet",
]
REQUIRED = Requirement(SHOWN[1], 10.0)
TWO = "angle_sensor.error_at_zero_range_rad=1e-4:4e-4:3,thruster.max_impulse_m_s=log:2:8:2"


@pytest.fixture
def file(brief: Scenario, tmp_path: Path, infoset: Infoset) -> Path:
    path = tmp_path / "brief.toml"
    path.write_text(to_toml(brief))
    return path


@pytest.fixture(scope="module")
def swept(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sweep that no command has flown: manifest and shards only."""
    folder = tmp_path_factory.mktemp("sweep") / "two"
    axes = sweep_axes(TWO, brief)
    Campaign(brief, 20, folder, guarantee=False, axes=axes, cells=sweep_cells(brief, axes)).run()
    return folder


@pytest.mark.usefixtures("rendered")
def test_a_sweep_of_two_keys(infoset: Infoset, brief: Scenario, file: Path, tmp_path: Path) -> None:
    folder = tmp_path / "sweep"
    code, out, err = infoset(
        "sweep", file, "--model", "paper", "--vary", TWO, "--runs", 30, "--out", folder, "--seed", 2
    )
    assert code == 0
    assert (
        f"wrote shards, scenario.toml, sweep.parquet, figure-sweep.pdf, figure-sweep.png, summary.json in {folder}"
        in err
    )
    assert sorted(each.name for each in folder.iterdir()) == FILES
    table = pq.read_table(folder / "sweep.parquet")
    assert table.num_rows == 6
    errors, impulses = (table.column(name).to_pylist() for name in table.column_names[1:3])
    assert list(zip(errors, impulses, strict=True)) == list(itertools.product((1e-4, 2.5e-4, 4e-4), (2.0, 8.0)))
    rows = table.to_pylist()
    for row in rows:
        sensor = replace(
            brief.set_model.angle_sensor, error_at_zero_range_rad=row["angle_sensor.error_at_zero_range_rad"]
        )
        cell = replace(
            brief,
            **of_model(replace(brief.set_model, angle_sensor=sensor)),
            thruster=replace(brief.thruster, max_impulse_m_s=row["thruster.max_impulse_m_s"]),
        )
        flown = simulate(cell, 30, seed=2)
        assert row["runs"] == 30
        assert row["miss_m_p90"] == np.quantile(flown.miss_m, 0.9)
        assert row["miss_m_p99"] is None
        assert row["impulse_m_s_p50"] == np.quantile(flown.impulse_m_s, 0.5)
        assert row["miss_m_max"] == flown.miss_m.max()
        assert row["miss_m_p99_upper"] is None
        assert row["miss_m_p50_lower"] in flown.miss_m
        assert row["truth_kept"] == int(flown.truth_kept.sum())
        assert row["set_emptied"] == int(flown.set_emptied.sum())
        assert row["arrived"] + row["set_empty"] + row["budget_spent"] + row["diverged"] == 30
    found = json.loads((folder / "summary.json").read_text())
    assert (found["kind"], found["scenario_hash"], found["runs"]) == ("sweep", fingerprint(brief), 180)
    assert [each["unit"] for each in found["axes"]] == ["rad", "m/s"]
    assert [each["at"] for each in found["answers"]] == [f"thruster.max_impulse_m_s = {each}" for each in (2, 8)]
    assert all(each["met"] in out for each in found["answers"])


@pytest.mark.usefixtures("rendered")
def test_a_sweep_of_one_key_mixed_and_resumed(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("sweep", file, "--vary", "thruster.max_impulse_m_s=2:8:4", "--runs", 20, "--noise", "mixed")
    code, out, _ = infoset(*asked, "--out", tmp_path / "a", "--require", "miss_m p90<3")
    assert code == 0
    assert out.count("noise: miss_m p90<3 is met in") == 1
    assert out.count("miss_m p90<3 is met against this adversary in") == 1
    assert out.count("along thruster.max_impulse_m_s:") == 2
    table = pq.read_table(tmp_path / "a" / "sweep.parquet")
    assert table.column("noise").to_pylist() == ["random", "game"] * 4
    assert set(table.column("runs").to_pylist()) == {10}
    before = (tmp_path / "a" / "sweep.parquet").read_bytes()
    for victim in list((tmp_path / "a" / "shards").glob("*.parquet"))[1:3]:
        victim.unlink()
    code, out, _ = infoset("report", tmp_path / "a")
    assert out.count("noise: miss_m p90<3 is met in") == 1
    assert out.count("miss_m p90<3 is met against this adversary in") == 1
    again = infoset(*asked, "--out", tmp_path / "a", "--require", "miss_m p90<3", "--resume", "-q")
    assert again == (0, "", "")
    assert (tmp_path / "a" / "sweep.parquet").read_bytes() == before
    code, _, err = infoset(*asked[:3], "thruster.max_impulse_m_s=2:9:4", *asked[4:], "--out", "a", "--resume")
    assert code == 2
    assert "axes: " in err
    assert "cells_hash" in err


def test_the_report_of_a_sweep_is_from_its_files_alone(infoset: Infoset, swept: Path, tmp_path: Path) -> None:
    code, out, _ = infoset("report", swept, "--out", tmp_path / "report", "--require", "impulse_m_s p50<60")
    assert code == 0
    assert "impulse_m_s p50<60 is met in" in out
    assert "angle_sensor.error_at_zero_range_rad (rows) and thruster.max_impulse_m_s (columns)" in out
    assert "rows in rad, columns in m/s; lines of a cell: decision, impulse_m_s p50 in m/s (- if too few runs), " in out
    assert re.search(r"met.*\n +[\d.]+ .*\n +[\d.]+ to [\d.]+ .*\n +20 +20", out)
    assert "brief, with range sensor, model paper, strategy symmetric-miss, seed 0\n" in out
    names = ["figure-sweep.pdf", "figure-sweep.png", "report.json", "scenario.toml", "sweep.parquet"]
    assert sorted(each.name for each in (tmp_path / "report").iterdir()) == names
    assert pq.read_table(tmp_path / "report" / "sweep.parquet").num_rows == 6
    assert load_scenario(tmp_path / "report" / "scenario.toml").name == "brief"


@pytest.mark.parametrize(
    ("second", "legend"),
    [
        ("information_set.sections=3:5:2", "lines of a cell: decision, "),
        ("thruster.budget_m_s=50:60:2", "columns in m/s; lines of a cell: decision, "),
    ],
)
def test_tables_name_the_units_of_the_axes_that_have_one(
    second: str, legend: str, infoset: Infoset, file: Path, tmp_path: Path
) -> None:
    axes = ("--vary", f"angle_sensor.scale=1:2:2,{second}")
    code, out, _ = infoset("sweep", file, *axes, "--runs", 2, "--out", tmp_path / "sweep")
    assert code == 0
    assert f"(columns)\n{legend}" in out


def test_three_keys_are_a_table_only(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    three = f"{TWO},information_set.sections=3:5:2"
    code, _, err = infoset("sweep", file, "--vary", three, "--runs", 2, "--out", tmp_path / "sweep")
    assert code == 0
    assert "a figure can show one or two keys only" in err
    assert sorted(each.name for each in (tmp_path / "sweep").iterdir()) == [
        each for each in FILES if not each.startswith("figure")
    ]
    assert pq.read_table(tmp_path / "sweep" / "sweep.parquet").num_rows == 12


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["--vary", "thruster.budget=1:2:2"], ["did you mean thruster.budget_m_s?"]),
        (["--vary", "thruster.max_impulse_m_s=0.01:5:3"], ["brief with thruster.max_impulse_m_s = 0.01"]),
        (["--require", "miss_m 10"], ["--require: must be hit>=SHARE or QUANTITY pLEVEL<BOUND, for example"]),
        (["--vary", "thruster.max_impulse_m_s=1_0:20:2"], ["must be a number, found"]),
        (["--show", "miss_m p99,fuel p50"], ["--show: there is no quantity fuel"]),
        (["--show", ",".join(f"miss_m p{each}" for each in range(1, 20))], ["--show: at most 8"]),
        (["--dask", "nowhere"], ["--dask"]),
        (["--runs", 300_000], ["6 cells of 300000 runs are 1800000 engagements", "give --yes"]),
    ],
)
def test_what_is_wrong_is_said_before_the_work(
    arguments: list[str],
    parts: list[str],
    infoset: Infoset,
    file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("sim.parallel.simulate_task", lambda *_: pytest.fail("began to work"))
    given = {"--vary": TWO, "--runs": 10, "--out": "sweep"} | dict(zip(arguments[::2], arguments[1::2], strict=True))
    code, out, err = infoset("sweep", file, *[part for pair in given.items() for part in pair])
    assert (code, out) == (2, "")
    assert err.count("error: ") == 1
    for part in parts:
        assert part in err
    assert [each.name for each in tmp_path.iterdir()] == ["brief.toml"]


@pytest.mark.parametrize("answer", ["y\n", "n\n"])
def test_a_large_sweep_asks_on_a_terminal(
    answer: str, infoset: Infoset, file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Begun(Exception):  # noqa: N818
        pass

    class Terminal:
        def isatty(self) -> bool:
            return True

        def readline(self) -> str:
            return answer

    def begin(*_: object, **__: object) -> None:
        raise Begun

    asked = ("sweep", file, "--vary", TWO, "--runs", 300_000, "--out", tmp_path / "sweep", "--workers", 1)
    monkeypatch.setattr("sim.Campaign.run", begin)
    with pytest.raises(Begun):
        infoset(*asked, "--yes")
    questions = []

    def confirm(text: str, **_: object) -> bool:
        questions.append(text)
        return answer == "y\n"

    monkeypatch.setattr("typer.confirm", confirm)
    monkeypatch.setattr("sys.stdin", Terminal())
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    if answer == "y\n":
        with pytest.raises(Begun):
            infoset(*asked)
    else:
        assert infoset(*asked)[0] == 2
    assert questions == ["6 cells of 300000 runs are 1800000 engagements, more than a million. Continue?"]


MET, NOT_MET, OPEN = Decision.MET, Decision.NOT_MET, Decision.UNDECIDED


def verdict(value: float | None, decision: Decision, bound: float = 10.0) -> Verdict:
    return Verdict(decision, 20, value, None, None, 20, 20, value, bound)


def test_limits_are_interpolated_between_neighbouring_decided_cells_only() -> None:
    axis = Axis("step_s", (1.0, 2.0, 4.0))
    met, missed, undecided = verdict(5.0, MET), verdict(15.0, NOT_MET), verdict(10.5, OPEN)
    assert limits(axis, (met, missed, met)) == [Limit(1.5, 1.0, 2.0), Limit(3.0, 2.0, 4.0)]
    (limit,) = limits(Axis("a", (1.0, 100.0), "log"), (met, missed))
    assert (limit.value, limit.lower, limit.upper) == pytest.approx((10.0, 1.0, 100.0))
    assert limits(axis, (met, undecided, missed)) == [Limit(None, 1.0, 4.0)]
    assert limits(axis, (met, None, missed)) == [Limit(None, 1.0, 4.0)]
    assert limits(axis, (undecided, missed, undecided)) == []
    assert limits(axis, (met, verdict(None, NOT_MET), missed)) == [Limit(None, 1.0, 2.0)]
    decades = (verdict(1.0, MET), verdict(100.0, NOT_MET))  # their logarithms are interpolated
    assert limits(Axis("a", (1.0, 2.0)), decades)[0].value == pytest.approx(1.5)


def limit_of_hits(scenario: Scenario, axis: Axis, runs: int, share: float, folder: Path) -> Limit:
    """Return the limit of the hits along an axis, with game noise."""
    cells = sweep_cells(scenario, (axis,))
    Campaign(scenario, runs, folder, noise=CampaignNoise.GAME, guarantee=False, axes=(axis,), cells=cells).run()
    ((limit,),) = (
        row.limits for row in answers(sweep_table(CampaignFolder.read(folder), HitRequirement(share)), "game")
    )
    return limit


def test_the_limit_of_hits_along_the_radius_is_the_quantile_of_the_miss(brief: Scenario, tmp_path: Path) -> None:
    """The radius changes no miss. An interpolated probability gave 19 % more."""
    misses_m = simulate(replace(brief, noise=NoiseKind.GAME), 80).miss_m
    quantile_m = float(np.quantile(misses_m, 0.95))
    axis = Axis("body.radius_m", (0.5 * quantile_m, 1.3 * quantile_m))
    limit = limit_of_hits(replace(brief, body=Body(8.0)), axis, 80, 0.95, tmp_path / "radius")
    assert limit.value == pytest.approx(quantile_m)


def test_the_limit_of_hits_is_that_of_a_fine_sweep(tmp_path: Path) -> None:
    """An interpolated probability gave 1.4e-5 rad, just above the last cell that meets the requirement."""
    short = ["nominal_range_km=8841.6", "uncertainty.x_km=[8831.6, 8851.6]", "dispersion.x_km=[8836.6, 8846.6]"]
    quick = ["step_s=20", "angle_sensor.period_s=20", "thruster.max_impulse_m_s=1"]
    scenario = load_scenario("dart-2022", [*short, *quick])
    coarse, fine = (
        limit_of_hits(
            scenario,
            Axis("angle_sensor.pixel_error_rad", tuple(np.linspace(1.3e-5, 2.5e-5, count).tolist())),
            *(40, 0.9, tmp_path / str(count)),
        )
        for count in (2, 7)
    )
    assert coarse.value is not None
    assert fine.upper - fine.lower < 0.4 * (coarse.upper - coarse.lower)
    assert fine.lower < coarse.value < fine.upper


@pytest.mark.parametrize(("first", "last"), [(11.0, 15.0), (5.0, 9.0), (11.0, 9.0)])
def test_no_limit_is_interpolated_if_an_estimate_contradicts_its_decision(first: float, last: float) -> None:
    axis = Axis("a", (1.0, 2.0))
    assert limits(axis, (verdict(first, MET), verdict(last, NOT_MET))) == [Limit(None, 1.0, 2.0)]


def test_an_early_decision_can_exclude_the_estimate_of_its_cell() -> None:
    required = Requirement(QuantileName("miss_m", 0.5), 10.0)
    turned = np.repeat([1.0, 20.0], [12, 60])
    met, missed = judge(turned, required, watched=True), judge(np.full(72, 20.0), required, watched=True)
    assert (met.decision, missed.decision) == (MET, NOT_MET)
    assert met.value == 20.0
    assert limits(Axis("a", (1.0, 2.0)), (met, missed)) == [Limit(None, 1.0, 2.0)]


def test_limits_hold_the_true_limit_of_an_exponential_dependence() -> None:
    """A straight line between the ends of the confidence intervals never holds it: the limit is 1.997."""
    axis, required = Axis("a", tuple(np.linspace(0.0, 4.0, 4))), Requirement(QuantileName("miss_m", 0.9), 10.0)
    generator, held = np.random.default_rng(3), 0
    factor = math.exp(0.5 * 1.2815515655446004)  # the 90 % quantile of the distribution below, by its median
    for _ in range(50):
        misses = np.exp(0.5 * generator.standard_normal(400)) / factor
        verdicts = [judge(0.5 * math.exp(1.5 * x) * misses, required, watched=False) for x in axis.values]
        (limit,) = limits(axis, verdicts)
        held += limit.lower <= math.log(20.0) / 1.5 <= limit.upper
        assert limit.value == pytest.approx(math.log(20.0) / 1.5, abs=0.1)
    assert held == 50


def test_answers_in_words() -> None:
    axis = Axis("step_s", (1.0, 2.0, 4.0))
    met, missed, undecided = verdict(5.0, MET), verdict(15.0, NOT_MET), verdict(10.5, OPEN)
    assert answer(axis, (met, missed, missed)).met == (
        "met at 1 s, not met from 2 to 4 s; limit between the decided cells 1 and 2 s, by interpolation about 1.5 s"
    )
    assert answer(axis, (met, undecided, missed)).met == (
        "met at 1 s, undecided at 2 s, not met at 4 s; limit between the decided cells 1 and 4 s"
    )
    assert answer(axis, (met, met, met)).met == "met at all 3 values"
    assert answer(axis, (undecided, undecided, undecided)).met == "undecided at all 3 values"
    assert answer(axis, (None, None, None)).met == "not simulated at all 3 values"


@pytest.mark.parametrize(
    ("key", "values", "words"),
    [
        (
            "a.b_m",
            (1000.1, 1000.2, 1000.3),
            "met at 1000.1 m, not met from 1000.2 to 1000.3 m; "
            "limit between the decided cells 1000.1 and 1000.2 m, by interpolation about 1000.15 m",
        ),
        (
            "a.b",
            (3000000.0, 3000001.0, 3000002.0),
            "met at 3000000, not met from 3000001 to 3000002; "
            "limit between the decided cells 3000000 and 3000001, by interpolation about 3000000.5",
        ),
        (
            "a.b_rad",
            (1e-5, 2e-5, 4e-5),
            "met at 1e-05 rad, not met from 2e-05 to 4e-05 rad; "
            "limit between the decided cells 1e-05 and 2e-05 rad, by interpolation about 1.5e-05 rad",
        ),
        (
            "a.b",
            (0.0, 900.0, 2500000.0),
            "met at 0, not met from 900 to 2500000; "
            "limit between the decided cells 0 and 900, by interpolation about 450",
        ),
    ],
)
def test_digits_of_answers_separate_neighbouring_cells(key: str, values: tuple[float, ...], words: str) -> None:
    assert answer(Axis(key, values), [verdict(5.0, MET), *[verdict(15.0, NOT_MET)] * 2]).met == words


@given(values=st.lists(st.floats(0.0, 20.0), min_size=2, max_size=12), bound=st.floats(1.0, 19.0))
def test_limits_lie_between_cells_on_either_side_of_the_bound(values: list[float], bound: float) -> None:
    axis = Axis("a", tuple(float(index) for index in range(len(values))))
    verdicts = [verdict(value, MET if value < bound else NOT_MET, bound) for value in values]
    found = limits(axis, verdicts)
    changes = [left for left in range(len(values) - 1) if (values[left] < bound) != (values[left + 1] < bound)]
    assert len(found) == len(changes)
    drawn = np.log if spans_decades(values) else np.array
    for limit, left in zip(found, changes, strict=True):
        assert limit.value is not None
        assert (left, left + 1) == (limit.lower, limit.upper)
        assert left <= limit.value <= left + 1
        assert np.interp(limit.value, axis.values, drawn(values)) == pytest.approx(drawn(bound), rel=1e-9, abs=1e-9)


def test_twenty_runs_decide_no_99_percent_quantile(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    key = "angle_sensor.error_at_zero_range_rad"
    code, out, _ = infoset("sweep", file, "--vary", f"{key}=1e-5:2e-5:2", "--runs", 20, "--out", tmp_path / "sweep")
    assert code == 0
    assert "miss_m p99<10 is met in 0, not met in 0, undecided in 2 of 2 cells" in out
    assert "  undecided at all 2 values" in out
    assert "2 cells are undecided after 20 runs; about 520 more runs per cell would decide" in out
    summary = json.loads((tmp_path / "sweep" / "summary.json").read_text())
    assert [cell["requirement"] for cell in summary["cells"]] == ["undecided"] * 2
    for cell in summary["cells"]:
        required = cell["samples"][0]["requirement"]
        assert required["lower"] < 10.0
        assert (required["value"], required["upper"], required["runs_needed"]) == (None, None, 535)


def test_runs_are_added_until_each_cell_is_decided(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    key = "angle_sensor.error_at_zero_range_rad"
    asked = ("sweep", file, "--vary", f"{key}=1e-5:3e-4:4", "--require", "miss_m p80<3", "--out", tmp_path / "sweep")
    code, out, _ = infoset(*asked, "--runs", 10)
    assert code == 0
    assert "to add runs to these cells: repeat infoset sweep with --resume and --until decided" in out
    code, out, _ = infoset(*asked, "--runs", 10, "--until", "decided", "--max-runs", 300, "--resume")
    assert code == 0
    assert (
        "the decision in each cell has a confidence of at least 95 % although runs are added until it is made;" in out
    )
    assert "this holds for each cell, and for all cells along a key together only if" in out
    summary = json.loads((tmp_path / "sweep" / "summary.json").read_text())
    assert (summary["complete"], summary["until"], summary["require"]) == (True, "miss_m p80<3", "miss_m p80<3")
    runs = [cell["samples"][0]["runs"] for cell in summary["cells"]]
    assert min(runs) == 50
    assert sum(runs) == summary["runs"] == summary["wanted_runs"]
    for cell in summary["cells"]:
        assert cell["requirement"] in ("met", "not-met") or cell["samples"][0]["runs"] == 300
    assert pq.read_table(tmp_path / "sweep" / "sweep.parquet").column("runs").to_pylist() == runs
    # The report uses the requirement of the sweep, and the test that allows for the added runs.
    code, out, _ = infoset("report", tmp_path / "sweep", "--json", "-")
    report = json.loads(out)
    assert report["require"] == "miss_m p80<3"
    assert report["cells"] == summary["cells"]


@pytest.mark.parametrize("until", [(), ("--until", "decided", "--max-runs", 60)])
def test_runs_without_a_guarantee_do_not_meet_a_bound_of_it(
    until: tuple[object, ...], infoset: Infoset, file: Path, tmp_path: Path
) -> None:
    """The sets of most runs become empty: the others alone have bounds, which all meet the requirement."""
    moving = ("--set", "target.manoeuvre=bang-bang", "--set", "target.acceleration_m_s2=1")
    asked = ("sweep", file, *moving, "--vary", "target.acceleration_m_s2=1.8:4:2", "--runs", 40, *until)
    code, out, _ = infoset(*asked, "--require", "guaranteed_miss_m p50<1e9", "--out", "sweep", "--json", "-")
    assert code == 0
    summary = json.loads(out)
    assert [answer["met"] for answer in summary["answers"]] == ["not met at all 2 values"]
    known = [cell["samples"][0]["requirement"]["known"] for cell in summary["cells"]]
    assert known == [cell["samples"][0]["phi_known"] for cell in summary["cells"]]
    assert sum(known) > 0
    code, out, _ = infoset("report", tmp_path / "sweep")
    assert f"{sum(known)} of {summary['runs']} runs have a value of guaranteed_miss_m" in out
    # The quantiles of so few values are not shown, although the number of runs would show them.
    sample = summary["cells"][0]["samples"][0]
    assert 0 < known[0] < 10
    assert sample["guaranteed_miss_m"]["p90"]["value"] is None
    assert sample["miss_m"]["p90"]["value"] is not None


def test_numbers_of_a_cell_agree_with_its_decision(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    """With two noises the cell has the hits of the worse noise; its needed runs count those of both."""
    asked = ("sweep", file, "--set", "body.radius_m=5", "--vary", "angle_sensor.scale=0.5:1.125:2", "--noise", "mixed")
    code, out, _ = infoset(*asked, "--runs", 40, "--out", tmp_path / "sweep", "--json", "-")
    assert code == 0
    summary = json.loads(out)
    assert summary["confidence_holds"]["requirement"] == "a fixed number of runs"
    for cell in summary["cells"]:
        worst = min(cell["samples"], key=lambda sample: sample["hit"]["probability"])
        assert cell["hit"] == worst["hit"]
        assert cell["hit"]["runs"] == 20
        assert cell["requirement"] == worst["requirement"]["decision"]
    assert [sample["requirement"]["runs_needed"] for sample in summary["cells"][0]["samples"]] == [210, 210]
    _, out, _ = infoset("report", tmp_path / "sweep")
    assert "1 cell is undecided after 40 runs per cell with all noises; about 170 more runs per cell would" in out


def test_runs_that_are_added_by_hand_are_judged_like_those_of_until(
    infoset: Infoset, file: Path, tmp_path: Path
) -> None:
    asked = ("sweep", file, "--set", "body.radius_m=8", "--vary", "angle_sensor.scale=0.5:3:3", "--out", "sweep")
    assert infoset(*asked, "--runs", 60)[0] == 0
    assert not read_manifest(tmp_path / "sweep").is_watched
    # Runs that are missing, and a repeated command, add no runs.
    next((tmp_path / "sweep" / "shards").glob("*.parquet")).unlink()
    assert infoset(*asked, "--runs", 60, "--resume")[0] == 0
    assert not read_manifest(tmp_path / "sweep").is_watched
    code, out, _ = infoset(*asked, "--runs", 100, "--resume")
    assert code == 0
    assert "the decision in each cell has a confidence of at least 95 % although runs were added" in out
    assert read_manifest(tmp_path / "sweep").is_watched
    summary = json.loads((tmp_path / "sweep" / "summary.json").read_text())
    assert summary["confidence_holds"] == {
        "requirement": "any number of runs",
        "hit": "a fixed number of runs",
        "quantiles": "a fixed number of runs",
    }
    rows = pq.read_table(tmp_path / "sweep" / "sweep.parquet").to_pylist()
    for cell, row in zip(summary["cells"], rows, strict=True):
        hits, required = cell["hit"], cell["samples"][0]["requirement"]
        assert (row["hits"], row["hit_probability"]) == (hits["hits"], hits["probability"])
        assert (row["hit_lower"], row["hit_upper"]) == (hits["lower"], hits["upper"])
        names = ("value", "lower", "upper", "known")
        assert [row[f"required_{name}"] for name in names] == [required[name] for name in names]
        lower, upper = share_interval(hits["hits"], 100)
        # The first run that decides is final: its bound is an end of the interval.
        assert required["lower"] == max(lower, 0.95 if cell["requirement"] == "met" else 0.0)
        assert required["upper"] == min(upper, 0.95 if cell["requirement"] == "not-met" else 1.0)
    # A sweep that was watched once stays so.
    assert infoset(*asked, "--runs", 100, "--resume", "--until", "decided", "--max-runs", 150)[0] == 0
    assert infoset(*asked, "--runs", 150, "--resume")[0] == 0
    assert read_manifest(tmp_path / "sweep").until is None
    assert read_manifest(tmp_path / "sweep").is_watched


def test_a_required_probability_of_a_hit(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("sweep", file, "--set", "body.radius_m=8", "--vary", "angle_sensor.scale=0.5:3:3", "--runs", 40)
    code, out, _ = infoset(*asked, "--out", tmp_path / "sweep")
    assert code == 0
    assert "random noise: hit>=0.95 is met in" in out
    summary = json.loads((tmp_path / "sweep" / "summary.json").read_text())
    flown = CampaignFolder.read(tmp_path / "sweep")
    for number, cell in enumerate(summary["cells"]):
        hits = int((flown.numbers("miss_m", number) <= 8.0).sum())
        estimate = estimate_hits(hits, 40)
        assert cell["hit"] == vars(estimate)
        expected = "met" if estimate.lower >= 0.95 else "not-met" if estimate.upper < 0.95 else "undecided"
        assert cell["requirement"] == cell["samples"][0]["requirement"]["decision"] == expected
        assert cell["samples"][0]["requirement"]["lower"] == estimate.lower
        assert cell["samples"][0]["requirement"]["upper"] == estimate.upper
    code, out, _ = infoset("report", tmp_path / "sweep", "--require", "hit > 0.5", "--json", "-")
    assert json.loads(out)["require"] == "hit>=0.5"


def test_a_required_guarantee_must_be_stored(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("sweep", file, "--vary", "angle_sensor.scale=1:2:2", "--runs", 2, "--out", "sweep")
    code, out, _ = infoset(*asked)
    assert code == 0
    assert "2 cells are undecided after 2 runs" in out
    code, out, err = infoset("report", tmp_path / "sweep", "--require", "guaranteed_miss_m p50<10")
    assert (code, out) == (2, "")
    assert "this sweep was simulated without the bound Phi; simulate it in a new folder with infoset" in err
    code, out, _ = infoset(*asked[:-1], "one", "--runs", 1)
    assert "2 cells are undecided after 1 run;" in out


def test_an_estimate_at_the_bound_does_not_tell_the_runs_that_are_needed(
    infoset: Infoset, file: Path, tmp_path: Path
) -> None:
    asked = ("sweep", file, "--vary", "angle_sensor.scale=1:2:2", "--runs", 10, "--out", tmp_path / "sweep")
    assert infoset(*asked)[0] == 0
    misses = np.sort(CampaignFolder.read(tmp_path / "sweep").numbers("miss_m", 0).data)
    _, out, _ = infoset("report", tmp_path / "sweep", "--require", f"miss_m p50<{misses[4:6].mean():.9f}")
    assert "the estimate is at the bound: the number of runs that would decide is not known yet" in out or (
        "the estimate is at the bound in 1 of them: the number of runs that would decide is not known yet" in out
    )


@pytest.mark.parametrize("requirement", ["hit>=0.95", "hit>0.5"])
def test_a_hit_needs_a_size(requirement: str, infoset: Infoset, file: Path, swept: Path, tmp_path: Path) -> None:
    asked = ("--vary", "angle_sensor.scale=1:2:2", "--runs", 2, "--out", "sweep", "--require", requirement)
    code, _, err = infoset("sweep", file, *asked)
    assert code == 2
    assert "has no [body]; set its radius, for example --set body.radius_m=80" in err
    code, _, err = infoset("report", swept, "--require", requirement)
    assert code == 2
    assert "the body of this sweep has no size" in err


def test_the_radius_can_be_varied(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("sweep", file, "--vary", "body.radius_m=log:1:1000:4", "--runs", 30, "--json", "-", "--out", "sweep")
    code, out, _ = infoset(*asked)
    assert code == 0
    cells = json.loads(out)["cells"]
    probabilities = [cell["hit"]["probability"] for cell in cells]
    assert probabilities == sorted(probabilities)
    assert probabilities[0] < probabilities[-1] == 1.0


def test_keys_with_the_same_values_and_factors_in_tables(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    one, other = "angle_sensor.error_at_zero_range_rad", "angle_sensor.error_at_nominal_range_rad"
    asked = ("--vary", f"{one}={other}=1e-4:3e-4:2", "--vary", "thruster.max_impulse_m_s=2:8:2")
    code, out, _ = infoset("sweep", file, *asked, "--runs", 5, "--out", "sweep", "--json", "-")
    assert code == 0
    summary = json.loads(out)
    assert [(axis["key"], axis["unit"]) for axis in summary["axes"]] == [
        (f"{one}={other}", "rad"),
        ("thruster.max_impulse_m_s", "m/s"),
    ]
    table = pq.read_table(tmp_path / "sweep" / "sweep.parquet")
    assert table.column(one).to_pylist() == table.column(other).to_pylist() == [1e-4, 1e-4, 3e-4, 3e-4]
    assert key_label(f"{one}={other}") == "angle sensor: error at zero range = error at nominal range, rad"
    assert key_label("range_sensor.scale") == "range sensor: factor of the error bounds"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--max-runs", 30), "--max-runs is the limit of --until; add --until decided"),
        (("--until", "decided", "--max-runs", 9), "--max-runs: must be at least --runs, 10, found 9"),
        (("--until", "never"), "--until"),
    ],
)
def test_limits_of_the_runs_that_do_not_fit(
    arguments: tuple[object, ...], message: str, infoset: Infoset, file: Path, tmp_path: Path
) -> None:
    code, _, err = infoset("sweep", file, "--vary", TWO, "--runs", 10, "--out", tmp_path / "sweep", *arguments)
    assert code == 2
    assert message in err
    assert not (tmp_path / "sweep").exists()


def test_keys_as_labels() -> None:
    assert key_label("angle_sensor.error_at_zero_range_rad") == "angle sensor: error at zero range, rad"
    assert key_label("uncertainty.vx_km_s.min") == "uncertainty: vx minimum, km/s"
    assert key_label("information_set.sections") == "information set: sections"
    assert key_label("thruster.last_impulse_s") == "thruster: last impulse before arrival, s"
    assert key_label("angle_sensor.first_image_s") == "angle sensor: first image before arrival, s"
    units = {"sun.gravitational_parameter_km3_s2": "km³/s²", "a.b_m_s2": "m/s²", "a.error_rad_s": "rad/s", "a.b_s": "s"}
    assert {key: unit_of(key) for key in units} == units


def test_requirements_as_titles_are_exact() -> None:
    words = {
        "hit>=0.9999999": "probability of a hit at least 0.9999999",
        "miss_m p99.995<10": "miss p99.995 under 10 m",
    }
    assert {text: requirement_words(parse_requirement(text)) for text in words} == words


def test_a_report_accepts_the_stored_requirement(infoset: Infoset, file: Path, tmp_path: Path) -> None:
    asked = ("sweep", file, "--vary", "body.radius_m=1:2:2", "--set", "body.radius_m=1", "--runs", 2, "--quiet")
    assert infoset(*asked, "--require", "hit>=0.9999999", "--out", tmp_path / "sweep")[0] == 0
    code, out, _ = infoset("report", tmp_path / "sweep", "--json", "-")
    assert (code, json.loads(out)["require"]) == (0, "hit>=0.9999999")


def test_figures_of_sweeps_with_two_keys(swept: Path) -> None:
    folder = CampaignFolder.read(swept)
    shown = [QuantileName(quantity, level) for quantity in ("miss_m", "impulse_m_s") for level in (0.5, 0.9)]
    middle = float(np.median(sweep_table(folder, REQUIRED).grid("random", shown[1]).compressed()))
    figure = draw_sweep(sweep_table(folder, Requirement(shown[1], middle)), shown, "random")
    need_room(figure)
    panels = [axes for axes in figure.axes if axes.get_xlabel()]
    assert panels[0].get_title() == f"(a) miss p90 under {middle:g} m; random noise"
    assert [axes.get_xlabel() for axes in panels] == ["angle sensor: error at zero range, $10^{-4}$ rad"] * 4
    assert {axes.get_ylabel() for axes in panels} == {"thruster: max impulse, m/s"}
    assert all(len(axes.texts) == 6 for axes in panels)
    # Twenty runs do not show a quantile of 99 %: it has no heat map, and a dash in the map of decisions.
    few = draw_sweep(sweep_table(folder, REQUIRED), SHOWN, "random")
    titles = [axes.get_title() for axes in few.axes if axes.get_xlabel()]
    assert [title.split(",")[1] for title in titles[1:]] == [" p50", " p50"]
    assert {text.get_text() for text in few.axes[0].texts} == {"\N{EN DASH}"}
    (legend,) = few.legends
    assert "\N{EN DASH} or white: too few runs for the quantile" in legend.get_title().get_text()
    assert "not drawn (too few runs): impulse spent p99" in legend.get_title().get_text()
    assert "limit by interpolation" not in [text.get_text() for text in legend.get_texts()]


def test_figures_of_sweeps_with_one_key(brief: Scenario, tmp_path: Path) -> None:
    axes = sweep_axes("thruster.max_impulse_m_s=2:8:3", brief)
    cells = sweep_cells(brief, axes)
    one = Campaign(brief, 30, tmp_path / "one", noise=CampaignNoise.MIXED, guarantee=False, axes=axes, cells=cells)
    one.run()
    table = sweep_table(CampaignFolder.read(tmp_path / "one"), REQUIRED)
    for noise in ("random", "game"):
        figure = draw_sweep(table, SHOWN, noise)
        need_room(figure)
        # Fifteen runs of a noise do not show a quantile of 99 %.
        note = f"{noise} noise; too few runs for p99"
        assert [axes.get_title() for axes in figure.axes] == [f"(a) {note}", f"(b) {note}"]
        (legend,) = figure.legends
        texts = [text.get_text() for text in legend.get_texts()]
        assert texts[:2] == ["p99: lower end only", "p50"]
        verdicts = [table.verdict(cell, noise) for cell in range(3)]
        drawn = {str(verdict.decision) for verdict in verdicts if verdict is not None}
        assert drawn == {text for text in texts if text in {str(decision) for decision in Decision}}
        assert [axes.get_ylabel() for axes in figure.axes] == ["miss, m", "impulse spent, m/s"]
    with pytest.raises(ValueError, match="one or two axes"):
        draw_sweep(table, [], "game")


def made_table(axes: Sequence[Axis], required: Requirement | HitRequirement, value: Callable[..., float]) -> SweepTable:
    """Return a table whose estimates are a function of the values of the axes."""
    samples, verdicts = [], []
    for values in itertools.product(*(axis.values for axis in axes)):
        middle = value(*values)
        estimates = {
            quantity: [QuantileEstimate(level, level * middle, 0.8 * level * middle, None) for level in (0.5, 0.99)]
            for quantity in ("miss_m", "impulse_m_s", "guaranteed_miss_m")
        }
        samples.append(
            (Sample("game", 100, estimates, {}, {}, SetCounts(20, 20), None, 0, 0, dict.fromkeys(estimates, 100)),)
        )
        share = 1.0 / (1.0 + middle)
        shown = middle if isinstance(required, Requirement) else share
        distance = math.log(shown / required.bound) * (-1.0 if isinstance(required, HitRequirement) else 1.0)
        decision = OPEN if abs(distance) < 0.2 else MET if distance < 0.0 else NOT_MET
        compared = math.exp(distance) * required.bound, required.bound
        verdicts.append({"game": Verdict(decision, 20, shown, 0.9 * shown, 1.1 * shown, 40, 20, *compared)})
    nothing = (None,) * len(samples)
    return SweepTable(tuple(axes), ("game",), (0.5, 0.99), tuple(samples), required, tuple(verdicts), nothing, 80.0)


@pytest.mark.parametrize("required", [REQUIRED, HitRequirement(0.95)])
@pytest.mark.parametrize(
    "axes",
    [
        (Axis("angle_sensor.scale", tuple(np.geomspace(0.01, 1000.0, 21)), "log"),),
        (Axis("angle_sensor.error_at_zero_range_rad", tuple(np.geomspace(1e-6, 1e-3, 8)), "log"),),
        (Axis("angle_sensor.error_at_zero_range_rad=angle_sensor.error_at_nominal_range_rad", (1e-6, 1.1e-6, 1e-3)),),
        (
            Axis("angle_sensor.error_at_zero_range_rad", tuple(np.linspace(1.23456e-4, 9.87654e-4, 8))),
            Axis("thruster.max_impulse_m_s", tuple(np.geomspace(0.1, 100.0, 15)), "log"),
        ),
        (
            Axis("nominal_range_km", tuple(np.linspace(5701.31, 5901.39, 8))),
            Axis("thruster.budget_m_s", (1.0, 1.01, 2.0, 2000.0)),
        ),
        (
            Axis("thruster.last_impulse_s", (30.0, 900.0)),
            Axis("angle_sensor.error_at_zero_range_rad=angle_sensor.error_at_nominal_range_rad", (1e-6, 1.1e-6, 1e-3)),
        ),
        (
            Axis("thruster.last_impulse_s", (30.0, 900.0)),
            Axis(
                "angle_sensor.error_at_nominal_range_rad=rate_sensor.error_rad_s=guidance.closing_speed_km_s",
                (1e-6, 1.1e-6),
            ),
        ),
    ],
)
def test_labels_never_touch(axes: tuple[Axis, ...], required: Requirement | HitRequirement) -> None:
    maximum = math.prod(axis.values[-1] for axis in axes)
    table = made_table(axes, required, lambda *values: 1000.0 * (math.prod(values) / maximum) ** 0.5)
    need_room(draw_sweep(table, SHOWN, "game"))


@pytest.mark.parametrize(
    "misses", [(100.0, 5.0, 4.0, 5.0, 20.0, 40.0, 80.0), (0.1, 0.2, 1.0, 5.0, 200.0, 400.0, 800.0)]
)
@pytest.mark.parametrize("scale", ["linear", "log"])
def test_interpolated_limits_are_marked_on_the_drawn_line(
    misses: tuple[float, ...], scale: Literal["linear", "log"]
) -> None:
    axis = Axis("angle_sensor.error_at_zero_range_rad", tuple(np.geomspace(1.2345e-6, 1.17e-3, 7)), scale)
    figure = draw_sweep(
        made_table([axis], REQUIRED, dict(zip(axis.values, misses, strict=True)).__getitem__), SHOWN, "game"
    )
    need_room(figure)
    axes = figure.axes[0]
    marks = [line for line in axes.lines if line.get_marker() == "D"]
    drawn = next(line for line in axes.lines if list(np.asarray(line.get_ydata())) == list(misses))
    assert len(marks) == (2 if misses[0] > 10.0 else 1)
    on_paper = axes.transData.transform(np.column_stack(drawn.get_data()))
    for mark in marks:
        ((x, y),) = axes.transData.transform(np.column_stack(mark.get_data()))
        assert np.interp(x, *on_paper.T) == pytest.approx(y, abs=1e-6)


def test_numbers_of_a_map_stay_off_its_lines_and_undecided_cells_have_no_limit() -> None:
    axes = (
        Axis("angle_sensor.pixel_error_rad", tuple(np.linspace(1e-6, 5e-5, 8).tolist())),
        Axis("thruster.last_impulse_s", tuple(np.linspace(30.0, 900.0, 8).tolist())),
    )
    required = Requirement(QuantileName("guaranteed_miss_m", 0.99), 25.0)
    table = made_table(axes, required, lambda error_rad, time_s: 0.05 * time_s + 1e5 * error_rad)
    figure = draw_sweep(table, SHOWN, "game")
    figure.draw_without_rendering()
    first = figure.axes[0]
    (line,) = [line for line in first.lines if line.get_color() == INK]
    vertices = first.transData.transform(np.asarray(line.get_xydata(), dtype=np.float64))
    x = np.linspace(vertices[0, 0], vertices[-1, 0], 2000)
    points = np.column_stack([x, np.interp(x, *vertices[vertices[:, 0].argsort()].T)])
    crossed = [
        text.get_text() for text in first.texts if text.get_window_extent().shrunk(1.0, 0.6).count_contains(points)
    ]
    assert len(crossed) <= 1, crossed
    undecided = [{"game": replace(each["game"], decision=OPEN)} for each in table.verdicts]
    few = draw_sweep(replace(table, verdicts=tuple(undecided)), [required.quantile], "game")
    assert not [line for line in few.axes[0].lines if line.get_color() == INK]
    assert [text.get_text() for text in few.legends[0].get_texts()] == ["undecided"]


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_the_limit_of_two_keys_is_a_line(scale: Literal["linear", "log"]) -> None:
    space = np.geomspace if scale == "log" else np.linspace
    axes = (
        Axis("angle_sensor.pixel_error_rad", tuple(space(1e-6, 5e-5, 8).tolist()), scale),
        Axis("thruster.last_impulse_s", tuple(space(30.0, 900.0, 8).tolist()), scale),
    )
    required = Requirement(QuantileName("guaranteed_miss_m", 0.99), 25.0)
    table = made_table(axes, required, lambda error_rad, time_s: 2e4 * error_rad * time_s)
    figure = draw_sweep(table, SHOWN, "game")
    need_room(figure)
    first = figure.axes[0]
    assert first.get_xlabel() == "angle sensor: pixel error, $10^{-6}$ rad"
    (drawn,) = [line for line in first.lines if line.get_color() == INK]
    error_rad, time_s = np.asarray(drawn.get_xydata(), dtype=np.float64).T
    if scale == "log":  # products are planes on logarithmic scales
        np.testing.assert_allclose(2e4 * error_rad * time_s, 25.0, rtol=1e-9)
    for row, at in zip(answers(table, "game"), axes[1].values, strict=True):
        for limit in row.limits:
            crossing = np.interp(-at, -time_s, error_rad)
            assert limit.lower <= crossing <= limit.upper
            assert limit.value is None or crossing == pytest.approx(limit.value, rel=1e-6)
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names[-1] == "limit by interpolation of the quantiles"
    combinations = itertools.product(*(axis.values for axis in axes))
    form = replace(table, closed_form_m=tuple(3e4 * error_rad * time_s for error_rad, time_s in combinations))
    figure = draw_sweep(form, [required.quantile], "game")
    assert figure.legends[0].get_texts()[-1].get_text() == "closed form: worst errors, no later images"
    one_known = replace(table, closed_form_m=(None,) * 63 + (3.0,))
    assert len(draw_sweep(one_known, [required.quantile], "game").axes[0].lines) == len(first.lines)


def test_an_unfinished_sweep_is_reported_as_far_as_it_is(infoset: Infoset, swept: Path, tmp_path: Path) -> None:
    shutil.copytree(swept, tmp_path / "two")
    for victim in sorted((tmp_path / "two" / "shards").glob("*.parquet"))[2:]:
        victim.unlink()
    code, out, err = infoset("report", tmp_path / "two", "--out", tmp_path / "report", "--json", "-")
    assert code == 0
    found: Any = json.loads(out)
    assert (found["runs"], found["wanted_runs"], found["complete"]) == (40, 120, False)
    assert "40 of 120 runs are stored" in err
    assert pq.read_table(tmp_path / "report" / "sweep.parquet").column("miss_m_p50").null_count == 4
    assert math.isfinite(found["cells"][0]["samples"][0]["miss_m"]["p50"]["value"])
    assert QuantileName("miss_m", 0.5) == SHOWN[0]
