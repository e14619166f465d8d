from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.experiments.common.input_file import load_problem
from infoset.experiments.common.printed_numbers import (
    NumberComparison,
    NumberVerdict,
    Ours,
    Paper,
    PrintedNumber,
    Progress,
    interval,
    last_digit,
    read_paper,
)
from infoset.experiments.pareto.published import PROBLEM, STARTS, results
from infoset.experiments.reproduced_numbers import PAPERS, reproduce_paper, result_at
from infoset.rendezvous.pareto import solve_encounter
from tests.experiments.command_line import Command, strict

X = PrintedNumber("table 1", "x (m)", "1.25")


def silent(_done: float) -> None:
    """Progress that nobody looks at."""


def only(*numbers: NumberComparison) -> Callable[[Paper, Progress], tuple[NumberComparison, ...]]:
    """In place of the numbers of a paper: these."""
    return lambda _paper, _progress: numbers


def test_a_result_is_unknown_if_it_or_a_value_around_it_is_none() -> None:
    results = {"a": None, "b": [0.0, None], "c": 0.0}

    assert math.isnan(result_at(results, "a"))
    assert math.isnan(result_at(results, "a.b.0"))
    assert math.isnan(result_at(results, "b.1"))
    assert result_at(results, "b.0") == 0.0


@pytest.mark.parametrize("key", ["c.d", "d", "b.2"])
def test_a_key_that_no_result_has_is_an_error(key: str) -> None:
    with pytest.raises((KeyError, IndexError, TypeError)):
        result_at({"b": [0.0, None], "c": 0.0}, key)


@pytest.mark.parametrize(
    ("text", "unit"),
    [("0.0690", 1e-4), ("-2018.0", 0.1), ("80", 1.0), ("5.58794e-8", 1e-13), ("1.20e3", 10.0)],
)
def test_last_digit_is_the_unit_of_the_last_printed_digit(text: str, unit: float) -> None:
    assert last_digit(text) == pytest.approx(unit, rel=1e-12)


@pytest.mark.parametrize(
    ("ours", "known", "verdict"),
    [
        (Ours(1.254), {}, NumberVerdict.AGREED),
        (Ours(1.2551), {}, NumberVerdict.DISAGREED),
        (Ours(1.2551), {"unexplained": math.inf}, NumberVerdict.NOT_EXPLAINED),
        (Ours(1.269), {"unexplained": 2.0}, NumberVerdict.NOT_EXPLAINED),
        (Ours(1.271), {"unexplained": 2.0}, NumberVerdict.DISAGREED),
        (Ours(1.254), {"unexplained": math.inf}, NumberVerdict.AGREED),
        (Ours(1.9, other=1.254), {}, NumberVerdict.EXPLAINED),
        (Ours(1.254, other=1.251), {}, NumberVerdict.AGREED),
        (Ours(1.9, other=1.8), {}, NumberVerdict.DISAGREED),
        (Ours(1.9, other=1.8), {"unexplained": math.inf}, NumberVerdict.NOT_EXPLAINED),
        (Ours(1.9, other=-1.251), {"corrected": "-1.25"}, NumberVerdict.MISPRINT),
        (Ours(-1.251, other=1.9), {"corrected": "-1.25"}, NumberVerdict.DISAGREED),
        (Ours(math.nan, other=1.251), {}, NumberVerdict.DISAGREED),
        (Ours(1.2551, beyond=0.01), {}, NumberVerdict.AGREED),
        (Ours(-1.251), {"corrected": "-1.25"}, NumberVerdict.MISPRINT),
        (Ours(1.251), {"corrected": "-1.25"}, NumberVerdict.DISAGREED),
        (Ours(1.4), {"agrees": (1.0, 1.4)}, NumberVerdict.AGREED),
        (Ours(1.41), {"agrees": (1.0, 1.4)}, NumberVerdict.DISAGREED),
        (Ours(math.nan), {"unexplained": math.inf}, NumberVerdict.DISAGREED),
        (Ours(math.inf), {"unexplained": math.inf}, NumberVerdict.DISAGREED),
        (Ours(1.256), {"tolerance": 1.0}, NumberVerdict.AGREED),
        (Ours(1.256), {"tolerance": 0.5}, NumberVerdict.DISAGREED),
        # One printed run must lie among ours.
        (Ours(1.5, spread=(0.1, 5.8)), {"printed": "5.7"}, NumberVerdict.POSSIBLE),
        (Ours(11.0, spread=(8.3, 12.1)), {"printed": "9.5"}, NumberVerdict.AGREED),
        (Ours(11.0, spread=(8.3, 12.1)), {"printed": "19.0"}, NumberVerdict.DISAGREED),
        (Ours(1.5, spread=(0.1, 5.8)), {"printed": "5.9"}, NumberVerdict.DISAGREED),
    ],
)
def test_verdict_follows_from_the_band_of_the_printed_number(
    ours: Ours, known: dict[str, Any], verdict: NumberVerdict
) -> None:
    assert NumberComparison(replace(X, **known), ours).verdict is verdict


@pytest.mark.parametrize("name", PAPERS)
def test_file_of_a_paper_is_read_with_its_defaults_and_notes(name: str) -> None:
    """No name stands twice, digits are numbers, and a number that may differ has the reason."""
    paper = read_paper(name)
    numbers = [number for numbers in paper.tables.values() for number in numbers]
    assert len({(number.source, number.name) for number in numbers}) == len(numbers)
    for number in numbers:
        assert last_digit(number.printed) > 0.0
        assert number.corrected is None or last_digit(number.corrected) > 0.0
        assert number.note or (number.corrected is None and number.unexplained == 0.0), number.name


def test_comparison_needs_a_computed_number_for_each_printed_one() -> None:
    paper = Paper("pareto", "a paper", (), {"table 1": (X, X)}, {})
    assert [each.ours.value for each in paper.compare({"table 1": [1.25, 1.5]})] == [1.25, 1.5]
    with pytest.raises(ValueError, match="shorter"):
        paper.compare({"table 1": [1.25]})
    with pytest.raises(KeyError, match="table 1"):
        paper.compare({})


def differences(velocities: np.ndarray, paper: Paper) -> np.ndarray:
    """Ours less the printed numbers that identify the start velocities, in units of their last
    digits.
    """
    settings = [
        "orbit_rate_rad_s=0.00117689",
        *(
            f"craft.{index}.velocity_m_s={each.tolist()}"
            for index, each in enumerate(velocities, start=1)
        ),
    ]
    ours: dict[str, Sequence[float]] = results(
        solve_encounter(load_problem(PROBLEM, settings).encounter), paper
    )
    return np.array(
        [
            (value - number.value) / last_digit(number.printed)
            for source in ("x(t) in section 3", "(3.1)", "table")
            for number, value in zip(paper.tables[source], ours[source], strict=True)
            if number.corrected is None
        ]
    )


def test_the_start_velocities_of_the_encounter_are_the_least_squares_fit() -> None:
    paper = read_paper("pareto")
    encounter = load_problem(PROBLEM, paper.options[STARTS]["settings"]).encounter
    fitted = np.array([craft.state[3:] for craft in encounter.craft])
    printed = np.array([craft.state[3:] for craft in load_problem(PROBLEM).encounter.craft])
    assert np.abs(fitted - printed).max() < 0.5e-4
    at = differences(fitted, paper)
    unit = 1e-4
    slopes = [differences(fitted + unit * step.reshape(3, 3), paper) - at for step in np.eye(9)]
    # A step of the Gauss-Newton method changes nothing, in units of the last printed digit.
    assert np.abs(np.linalg.lstsq(np.stack(slopes, axis=1), at, rcond=None)[0]).max() < 1e-5
    # The printed velocities alone do not give the last digits, but give the positions of the table
    # to 4e-4 m.
    rounded = results(
        solve_encounter(load_problem(PROBLEM, ["orbit_rate_rad_s=0.00117689"]).encounter), paper
    )
    for number, value in zip(paper.tables["table"], rounded["table"], strict=True):
        low, high = interval(number.printed, 0.5, 4e-4)
        assert number.corrected is not None or low <= value <= high, number.name
    assert np.abs(differences(printed, paper)).max() > 2.0


def test_reproduce_prints_one_paper_as_json_and_as_text(infoset: Command, tmp_path: Path) -> None:
    file = tmp_path / "numbers.json"
    code, out, _ = infoset("reproduce", "--paper", "pareto", "--json", file)
    assert code == 0
    (paper,) = strict(file.read_text())["papers"]
    assert paper["paper"] == "pareto"
    assert paper["verdicts"] == {
        **dict.fromkeys(("possible", "explained by another model", "disagreed"), 0),
        "agreed": 135,
        "misprint": 9,
        "not explained": 3,
    }
    by_name = {each["name"]: each for each in paper["numbers"]}
    first = by_name["first, x_3(10) (m)"]
    assert (first["source"], first["printed"], first["verdict"]) == ("table", "15.8021", "agreed")
    assert first["agrees_from"] <= first["ours"] <= first["agrees_to"]
    mended = by_name["first, x_3, 1"]
    assert (mended["corrected"], mended["verdict"]) == ("8.73291025e7", "misprint")
    assert all(each["note"] for each in paper["numbers"] if each["verdict"] != "agreed")
    for piece in (
        "-28.795",
        "not explained",
        "misprint (2)",
        "right: 8.73291025e7",
        "0.00117689",
        "147 numbers",
    ):
        assert piece in out


@pytest.mark.parametrize("ours", [1.3, math.nan])
def test_disagreeing_number_is_named_and_the_exit_code_is_1(
    ours: float, infoset: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    numbers = (
        NumberComparison(X, Ours(1.25)),
        NumberComparison(replace(X, name="y (m)"), Ours(ours)),
        NumberComparison(replace(X, name="z (m)", note="a circle"), Ours(1.9, other=1.2512)),
    )
    monkeypatch.setattr("infoset.experiments.reproduced_numbers.reproduce_paper", only(*numbers))
    run = partial(infoset, "reproduce", "--paper", "reachability")
    code, out, err = run("--json", "-", "-q")
    assert code == 1
    assert f"table 1, y (m): 1.25, ours {ours}" in err
    assert "x (m)" not in err
    found = strict(out)["papers"][0]["numbers"]
    assert [each["verdict"] for each in found] == [
        "agreed",
        "disagreed",
        "explained by another model",
    ]
    assert [each["ours"] for each in found] == [1.25, 1.3 if ours == 1.3 else None, 1.9]
    assert [each["other_model"] for each in found] == [None, None, 1.2512]
    assert "1.25  1.9000       1.2512  explained by another model (1)" in run()[1]


def test_reachability_tables_stand_as_the_theory_says() -> None:
    found = reproduce_paper(read_paper("reachability"), silent)
    assert len(found) == 3 * (12 + 24 + 24 + 1)
    verdicts = [each.verdict for each in found]
    assert [verdicts.count(verdict) for verdict in NumberVerdict] == [95, 0, 16, 69, 3, 0]
    by_name = {(each.number.source, each.number.name): each for each in found}
    for source, name in (
        ("table 1", "linear x5(3) (m/s)"),
        ("table 1", "linear x6(1) (m/s)"),
        ("table 2", "u2(0)"),
        ("table 2", "linear x3(3) (m)"),
        ("table 3", "u2(0)"),
        ("table 3", "linear x4(3) (m/s)"),
        ("table 1", "nonlinear x1(2) (m)"),
        ("table 3", "nonlinear x6(4) (m/s)"),
        ("table 3", "linear x3(2) (m)"),
    ):
        assert by_name[source, name].verdict is NumberVerdict.MISPRINT, name
    controls = [
        each for each in found if each.number.source == "table 1" and each.number.name[0] == "u"
    ]
    assert [each.verdict for each in controls] == [NumberVerdict.AGREED] * 12
    for table in (1, 2, 3):
        miss = by_name[f"table {table}", "nonlinear, norm of x(4)"]
        assert miss.verdict is NumberVerdict.NOT_EXPLAINED
        assert miss.ours.value < 3.0
    assert by_name["table 2", "linear x2(2) (m)"].band[1] > -1343.0
    assert by_name["table 1", "linear x1(2) (m)"].band == interval("937.24", 0.5)


@pytest.mark.parametrize(
    ("name", "tables"),
    [("multipoint", 9), ("pursuit", 1), pytest.param("pursuit", 9, marks=pytest.mark.thorough)],
)
def test_results_of_commands_agree(name: str, tables: int) -> None:
    paper = read_paper(name)
    found = reproduce_paper(replace(paper, tables=dict([*paper.tables.items()][:tables])), silent)
    assert {each.verdict for each in found} == {NumberVerdict.AGREED}


@pytest.mark.thorough
def test_the_interception_agrees_but_for_its_impulses() -> None:
    found = reproduce_paper(read_paper("interception"), silent)
    assert len(found) == 16
    open_ = [each.number.printed for each in found if each.verdict is not NumberVerdict.AGREED]
    assert open_ == ["4.3", "244.7", "521.7"]
