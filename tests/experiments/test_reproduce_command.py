from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from experiments.common.printed_numbers import (
    Band,
    Comparison,
    Origin,
    Ours,
    Paper,
    PrintedNumber,
    Progress,
    Reproduction,
    Verdict,
    last_digit,
    read_paper,
)
from experiments.interception.scenario_file import load_scenario
from experiments.pareto import published as pareto
from experiments.pareto.file import load_pareto
from experiments.reproduced_numbers import PAPERS, reproduce_paper
from sim.storage.codec import fingerprint
from sim.versions import versions

Infoset = Callable[..., tuple[int, str, str]]
X = PrintedNumber("table 1", "x (m)", "1.25")


def silent(_done: float) -> None:
    """Progress that nobody looks at."""


@pytest.fixture
def infoset(infoset: Infoset, monkeypatch: pytest.MonkeyPatch) -> Infoset:
    """Run `infoset reproduce` in an empty folder."""
    monkeypatch.setenv("COLUMNS", "80")
    return partial(infoset, "reproduce")


@pytest.fixture(scope="module")
def encounter() -> Reproduction:
    return reproduce_paper("pareto", silent)


def only(*numbers: Comparison) -> Callable[[str, Progress], Reproduction]:
    """In place of the papers: one with these numbers."""

    def reproduced(name: str, _progress: Progress) -> Reproduction:
        paper = Paper(name, "a paper", ("A remark.",), {})
        return Reproduction(paper, (("problem", "0" * 16),), numbers)

    return reproduced


@pytest.mark.parametrize(
    ("text", "unit"), [("0.0690", 1e-4), ("-2018.0", 0.1), ("80", 1.0), ("5.58794e-8", 1e-13), ("1.20e3", 10.0)]
)
def test_the_last_digit_of_what_is_printed(text: str, unit: float) -> None:
    assert last_digit(text) == pytest.approx(unit, rel=1e-12)


@pytest.mark.parametrize(
    ("ours", "known", "verdict"),
    [
        (Ours(1.254), {}, Verdict.AGREED),
        (Ours(1.2551), {}, Verdict.DISAGREED),
        (Ours(1.2551), {"unexplained": math.inf}, Verdict.NOT_EXPLAINED),
        (Ours(1.269), {"unexplained": 2.0}, Verdict.NOT_EXPLAINED),
        (Ours(1.271), {"unexplained": 2.0}, Verdict.DISAGREED),
        (Ours(1.254), {"unexplained": math.inf}, Verdict.AGREED),
        (Ours(1.9, other=1.254), {}, Verdict.EXPLAINED),
        (Ours(1.254, other=1.251), {}, Verdict.AGREED),
        (Ours(1.9, other=1.8), {}, Verdict.DISAGREED),
        (Ours(1.9, other=1.8), {"unexplained": math.inf}, Verdict.NOT_EXPLAINED),
        (Ours(1.9, other=-1.251), {"corrected": "-1.25"}, Verdict.MISPRINT),
        (Ours(-1.251, other=1.9), {"corrected": "-1.25"}, Verdict.DISAGREED),
        (Ours(None, other=1.251), {}, Verdict.DISAGREED),
        (Ours(1.2551, beyond=0.01), {}, Verdict.AGREED),
        (Ours(-1.251), {"corrected": "-1.25"}, Verdict.MISPRINT),
        (Ours(1.251), {"corrected": "-1.25"}, Verdict.DISAGREED),
        (Ours(1.4), {"agrees": (1.0, 1.4)}, Verdict.AGREED),
        (Ours(1.41), {"agrees": (1.0, 1.4)}, Verdict.DISAGREED),
        (Ours(None), {"unexplained": math.inf}, Verdict.DISAGREED),
        (Ours(math.nan), {"unexplained": math.inf}, Verdict.DISAGREED),
        (Ours(math.inf), {"unexplained": math.inf}, Verdict.DISAGREED),
        (Ours(1.256), {"tolerance": 1.0}, Verdict.AGREED),
        (Ours(1.256), {"tolerance": 0.5}, Verdict.DISAGREED),
    ],
)
def test_verdicts(ours: Ours, known: dict[str, Any], verdict: Verdict) -> None:
    assert Comparison(replace(X, **known), ours).verdict is verdict


@pytest.mark.parametrize(("printed", "verdict"), [("5.7", Verdict.AGREED), ("5.9", Verdict.DISAGREED)])
def test_one_printed_run_must_lie_among_ours(printed: str, verdict: Verdict) -> None:
    number = Comparison(replace(X, printed=printed), Ours(1.5, spread=Band(0.1, 5.8)))
    assert number.verdict is verdict


@pytest.mark.parametrize("name", PAPERS)
def test_the_file_of_a_paper(name: str) -> None:
    """No name stands twice, digits are numbers, and a number that may differ has the reason."""
    paper = read_paper(name)
    assert paper.title
    numbers = [number for numbers in paper.tables.values() for number in numbers]
    assert len({(number.source, number.name) for number in numbers}) == len(numbers)
    for number in numbers:
        assert last_digit(number.printed) > 0.0
        assert number.corrected is None or last_digit(number.corrected) > 0.0
        assert number.note or (number.corrected is None and number.unexplained == 0.0), number.name


def test_every_number_of_a_file_needs_one_of_ours() -> None:
    paper = Paper("pareto", "a paper", (), {"table 1": (X, X)})
    assert [each.ours.value for each in paper.compare({"table 1": [1.25, None]})] == [1.25, None]
    with pytest.raises(ValueError, match="shorter"):
        paper.compare({"table 1": [1.25]})
    with pytest.raises(KeyError, match="table 1"):
        paper.compare({})


def test_the_pareto_numbers_follow_from_start_velocities_within_their_rounding(encounter: Reproduction) -> None:
    found = [each for each in encounter.numbers if each.number.source.startswith("section 3, x(0)")]
    assert len(found) == 9
    assert all(abs((each.ours.value or math.inf) - each.number.value) < 0.5e-4 for each in found)
    assert encounter.count(Verdict.DISAGREED) == 0
    assert encounter.count(Verdict.NOT_EXPLAINED) == 3
    assert len(encounter.numbers) > 140


def test_the_printed_start_velocities_alone_do_not_give_the_last_digits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pareto, "_STEPS", 0)
    rounded = reproduce_paper("pareto", silent)
    assert rounded.count(Verdict.DISAGREED) > 40
    table = [each for each in rounded.numbers if each.number.source == "table" and "e" not in each.number.printed]
    # Theory: but for 4e-4 m they give the table's positions.
    for each in table:
        assert each.ours.value is not None
        assert each.ours.value in Band.of_digits(each.number.printed, 0.5, 4e-4), each.number.name


def test_json_of_one_paper(infoset: Infoset, tmp_path: Path) -> None:
    file = tmp_path / "numbers.json"
    code, out, err = infoset("--paper", "pareto", "--json", file)
    assert (code, err.splitlines()[-1]) == (0, f"wrote numbers.json in {tmp_path}")
    found = json.loads(file.read_text(), parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    assert found["versions"] == versions()
    (paper,) = found["papers"]
    assert paper["paper"] == "pareto"
    assert paper["problems"] == [{"name": "pareto-2008", "hash": fingerprint(load_pareto("pareto-2008"))}]
    assert sum(paper["verdicts"].values()) == len(paper["numbers"])
    by_name = {each["name"]: each for each in paper["numbers"]}
    first = by_name["first, x_3(10) (m)"]
    assert (first["source"], first["printed"], first["verdict"]) == ("table", "15.8021", "agreed")
    assert first["agrees_from"] <= first["ours"] <= first["agrees_to"]
    mended = by_name["first, x_3, 1 (SI)"]
    assert (mended["corrected"], mended["verdict"]) == ("8.73291025e7", "misprint")
    assert all(each["note"] for each in paper["numbers"] if each["verdict"] != "agreed")
    for piece in ("-28.795", "not explained", "misprint (2)", "0.00117689", "pareto: 147 numbers"):
        assert piece in out
    assert infoset("--paper", "pareto", "--json", file)[0] == 2
    assert max(len(line) for line in out.splitlines() if "agreed" in line and ":" not in line) <= 80


def test_json_alone_and_quiet(infoset: Infoset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    right = Comparison(X, Ours(1.2501))
    monkeypatch.setattr("experiments.reproduced_numbers.reproduce_paper", only(right))
    code, out, err = infoset("--json", "-")
    assert code == 0
    assert [each["paper"] for each in json.loads(out)["papers"]] == list(PAPERS)
    assert "1 agreed" in err
    assert infoset("-q") == (0, "", "")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ours", [1.3, None, math.nan])
def test_a_number_that_should_agree_and_does_not(
    ours: float | None, infoset: Infoset, monkeypatch: pytest.MonkeyPatch
) -> None:
    right, wrong = Comparison(X, Ours(1.25)), Comparison(replace(X, name="y (m)"), Ours(ours))
    monkeypatch.setattr("experiments.reproduced_numbers.reproduce_paper", only(right, wrong))
    code, out, err = infoset("--paper", "reachability", "--json", "-", "-q")
    assert code == 1
    assert "table 1, y (m): paper prints: 1.25, ours" in err
    assert "x (m)" not in err
    numbers = json.loads(out)["papers"][0]["numbers"]
    assert [each["verdict"] for each in numbers] == ["agreed", "disagreed"]
    assert numbers[1]["ours"] == (1.3 if ours == 1.3 else None)


def test_printed_numbers_other_computations_and_our_spread_are_apart(
    infoset: Infoset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each origin has its own table with its own titles, and no digit is cut on a screen of 60 columns."""
    long, digits = "a rather long name of a number (m^2/s^3)", "-1.2345678901e-7"
    rows = [
        (PrintedNumber("table 1", long, digits), Ours(float(digits))),
        (PrintedNumber("one run", "random, miss (m)", "4.3"), Ours(1.5, spread=Band(0.067, 4.98))),
        (PrintedNumber("figure 4", "miss (m)", "1.2", origin=Origin.OTHER), Ours(1.21)),
        (PrintedNumber("cubic spline", "I", "41.076923077", origin=Origin.EXACT), Ours(41.0769230769)),
    ]
    numbers = [Comparison(number, ours) for number, ours in rows]
    monkeypatch.setattr("experiments.reproduced_numbers.reproduce_paper", only(*numbers))
    monkeypatch.setenv("COLUMNS", "60")
    code, out, _ = infoset("--paper", "pareto")
    assert code == 0
    titles = ("paper prints", "paper, one run  our median  5 to 95 % of ours", "other program")
    for text in (*titles, "exact", "-1.2345678901e-7", "-1.23456789010e-07", "0.067 .. 4.98", "41.076923077", "5e-18"):
        assert text in out
    assert "…" not in out
    assert [line for line in out.splitlines() if len(line) > 60] == []
    code, out, _ = infoset("--paper", "pareto", "--json", "-", "-q")
    origins = [number["origin"] for number in json.loads(out)["papers"][0]["numbers"]]
    assert origins == ["paper", "paper", "other implementation", "closed form"]


def test_a_wrong_rate_is_seen(infoset: Infoset, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pareto, "RATE_RAD_S", 0.001176)
    code, out, err = infoset("--paper", "pareto", "-q")
    assert (code, out) == (1, "")
    assert "disagreed: pareto, " in err


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (
            ["--paper", "paretto"],
            ["--paper", 'there is no "paretto"; did you mean pareto? choose one of: interception, '],
        ),
        (["--paper", "number"], ['there is no "number"; choose one of: interception, pareto']),
        (["--paper", "../pareto"], ['there is no "../pareto"']),
        (["--json", "missing/numbers.json"], ["there is no folder"]),
    ],
)
def test_bad_input(infoset: Infoset, tmp_path: Path, arguments: list[str], parts: list[str]) -> None:
    code, out, err = infoset(*arguments)
    assert (code, out) == (2, "")
    assert all(part in err for part in parts), err
    assert err.startswith("error: ")
    assert err.count("error: ") == 1
    assert list(tmp_path.iterdir()) == []


def test_reachability_tables_stand_as_the_theory_says() -> None:
    found = reproduce_paper("reachability", silent)
    assert len(found.numbers) == 3 * (12 + 24 + 24 + 1)
    counts = {verdict: found.count(verdict) for verdict in Verdict}
    assert counts == {
        Verdict.AGREED: 95,
        Verdict.MISPRINT: 16,
        Verdict.EXPLAINED: 69,
        Verdict.NOT_EXPLAINED: 3,
        Verdict.DISAGREED: 0,
    }
    by_name = {(each.number.source, each.number.name): each for each in found.numbers}
    # Misprints of tables 1 to 3.
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
        assert by_name[source, name].verdict is Verdict.MISPRINT, name
    controls = [each for each in found.numbers if each.number.source == "table 1" and each.number.name[0] == "u"]
    assert [each.verdict for each in controls] == [Verdict.AGREED] * 12
    for table in (1, 2, 3):
        miss = by_name[f"table {table}", "nonlinear, norm of x(4)"]
        assert miss.verdict is Verdict.NOT_EXPLAINED
        assert miss.ours.value is not None
        assert miss.ours.value < 3.0
    assert by_name["table 2", "linear x2(2) (m)"].band.highest > -1343.0
    assert by_name["table 1", "linear x1(2) (m)"].band == Band.of_digits("937.24", 0.5)


def test_numbers_of_another_model_have_a_column(infoset: Infoset, monkeypatch: pytest.MonkeyPatch) -> None:
    circle = replace(X, note="a circle")
    numbers = (
        Comparison(circle, Ours(1.9, other=1.2512)),
        Comparison(replace(X, name="y (m)"), Ours(1.25)),
        Comparison(replace(circle, name="z (m)", corrected="1.35"), Ours(1.9, other=1.35)),
    )
    monkeypatch.setattr("experiments.reproduced_numbers.reproduce_paper", only(*numbers))
    code, out, _ = infoset("--paper", "pareto")
    assert code == 0
    lines = [line.split() for line in out.splitlines()]
    assert ["1.25", "1.9000", "1.2512", "0.005", "explained", "by", "another", "model", "(1)"] in [
        each[-9:] for each in lines
    ]
    assert ["1.25", "1.9000", "1.3500", "0.005", "misprint,", "right:", "1.35", "(1)"] in [each[-8:] for each in lines]
    assert "other model" in out
    assert "1 agreed, 1 misprint, 1 explained by another model" in out
    code, out, _ = infoset("--paper", "pareto", "--json", "-", "-q")
    assert [each["other_model"] for each in json.loads(out)["papers"][0]["numbers"]] == [1.2512, None, 1.35]


@pytest.mark.thorough
def test_the_whole_run(infoset: Infoset) -> None:
    code, out, err = infoset("--json", "-", "-q")
    assert (code, err) == (0, "")
    papers = {each["paper"]: each for each in json.loads(out)["papers"]}
    assert list(papers) == list(PAPERS)
    assert all(each["verdicts"]["disagreed"] == 0 for each in papers.values())
    assert [each["verdicts"]["not explained"] for each in papers.values()] == [2, 3, 0, 3, 0]
    single = load_scenario("asteroid-1997-single")
    assert papers["interception"]["problems"][0] == {"name": single.name, "hash": fingerprint(single)}
    unexplained = [each for each in papers["interception"]["numbers"] if each["verdict"] == "not explained"]
    assert [each["printed"] for each in unexplained] == ["244.7", "521.7"]
    misses = [each for each in papers["interception"]["numbers"] if each["printed"] in {"4.3", "9.5"}]
    assert [(each["verdict"], each["agrees_by"]) for each in misses] == [("agreed", "printed")] * 2
