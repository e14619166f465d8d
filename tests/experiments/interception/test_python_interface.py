"""The functions of `experiments` from Python: scenarios by name, files and figures."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import pytest

import experiments
import sim
from experiments import find_worst, fly_one, load_scenario, lower_bound, save, simulate
from experiments.common.errors import InputError
from sim import Record, Results
from tests.built_in import scenario_text

NAME = "asteroid-1997-single"


@pytest.fixture(scope="module")
def results() -> Results:
    return simulate(NAME, 3, seed=4, strategy="patient")


@pytest.fixture(scope="module")
def record() -> Record:
    return fly_one(NAME, seed=4, strategy="patient")


def test_names_and_paths_give_the_numbers_of_scenarios(results: Results, record: Record, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(scenario_text(NAME))
    again = sim.simulate(load_scenario(NAME), 3, seed=4, strategy="patient")
    assert results.to_dict() == again.to_dict() == simulate(file, 3, seed=4, strategy="patient").to_dict()
    assert record.result.miss_m[0] == results.miss_m[0]
    assert record.strategy == record.scenario.strategy == "patient"
    assert results.to_dict() != simulate(NAME, 3, seed=4).to_dict()


def test_the_search_and_the_bound_take_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sim.bound.lower_bound.PERIODS_LOOKED_AT", 1)  # few labels
    monkeypatch.setattr("sim.bound.lower_bound.REFINEMENTS", 0)
    assert find_worst(NAME, budget=4, strategy="patient").strategy == "patient"
    assert len(repr(lower_bound(NAME))) < 100


def test_a_name_given_to_sim_says_which_functions_take_names() -> None:
    name: Any = NAME
    for function in (sim.simulate, sim.fly_one, sim.find_worst, sim.lower_bound):
        with pytest.raises(TypeError, match=r"got 'asteroid-1997-single'; experiments\.simulate .*load_scenario"):
            function(name)


def test_dir_lists_the_public_names() -> None:
    assert dir(experiments) == sorted(experiments.__all__)
    assert all(hasattr(experiments, name) for name in dir(experiments))


def test_unknown_names_are_refused() -> None:
    with pytest.raises(InputError, match="nowhere"):
        simulate("nowhere", 1)
    with pytest.raises(ValueError, match="no strategy is called 'patience'"):
        simulate(NAME, 1, strategy="patience")


def test_results_are_saved_by_suffix(results: Results, tmp_path: Path) -> None:
    save(results, tmp_path / "results.json")
    assert json.loads((tmp_path / "results.json").read_text()) == results.to_dict()
    save(results, tmp_path / "results.csv")
    rows = list(csv.DictReader((tmp_path / "results.csv").read_text().splitlines()))
    assert list(rows[0]) == list(results.to_dict())
    assert [float(row["miss_m"]) for row in rows] == results.miss_m.tolist()
    with pytest.raises(InputError, match=r"results are written as \.csv or \.json"):
        save(results, tmp_path / "results.xlsx")
    with pytest.raises(InputError, match=r"results\.csv"):
        save(results, tmp_path / "results.csv")
    save(results, tmp_path / "results.csv", overwrite=True)


def test_pandas_gets_the_columns(results: Results) -> None:
    frame = results.to_pandas()
    assert {name: frame[name].tolist() for name in ("run", "miss_m", "outcome")} == {
        name: results.to_dict()[name] for name in ("run", "miss_m", "outcome")
    }
    units = frame.attrs["units"]
    assert (units["miss_m"], units["start_vz_m_s"], units["outcome"]) == ("m", "m/s", "")
