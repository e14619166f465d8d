"""Files of results: `save` and `load_results`."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset import InputError, load_results, load_scenario, save, simulate
from infoset.sim import Results

SCENARIOS = ("asteroid-1997-single", "asteroid-1997-space", "dart-2022", "comet-fast")
"""One in a plane, in space, with a body and a guarantee, and with starts that are drawn again."""


@pytest.fixture(scope="module", params=SCENARIOS)
def results(request: pytest.FixtureRequest) -> Results:
    return simulate(load_scenario(request.param), 3, seed=4)


@pytest.fixture
def saved(results: Results, tmp_path: Path) -> Path:
    file = tmp_path / "results.json"
    save(results, file)
    return file


def test_loaded_results_equal_the_saved_ones(results: Results, saved: Path) -> None:
    again = load_results(saved)

    assert again.to_dict() == results.to_dict()
    assert repr(again) == repr(results)
    assert (again.guarantees, again.b_plane_t_rad) == (results.guarantees, results.b_plane_t_rad)
    np.testing.assert_equal(again.burns_m_s, results.burns_m_s)
    for name in ("miss_m", "position_m", "velocity_m_s", "lateral_miss_m", "runs", "truth_kept"):
        mine = getattr(again, name)
        theirs = getattr(results, name)
        assert (mine.shape, mine.dtype) == (theirs.shape, theirs.dtype)
        np.testing.assert_array_equal(mine, theirs)


def test_results_are_written_as_csv(results: Results, tmp_path: Path) -> None:
    save(results, tmp_path / "results.csv")

    text = (tmp_path / "results.csv").read_text()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert text == results.to_csv()
    assert list(rows[0]) == list(results.to_dict())
    assert [float(row["miss_m"]) for row in rows] == results.miss_m.tolist()


def test_file_of_another_kind_is_refused(results: Results, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"results are written as \.json or \.csv"):
        save(results, tmp_path / "results.xlsx")


def test_existing_file_is_replaced_only_on_request(results: Results, saved: Path) -> None:
    with pytest.raises(InputError, match="exists already"):
        save(results, saved)
    save(results, saved, overwrite=True)


Change = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda file: file.update(format="infoset-results-9"), "its key"),
        (lambda file: file.update(more=1), "its keys are not"),
        (lambda file: file.update(guarantees="yes"), "true or false"),
        (lambda file: file.update(columns=[1]), "must be a table"),
        (lambda file: file["columns"].pop("miss_m"), "column 'miss_m' is missing"),
        (lambda file: file["columns"].update(colour=["red"] * 3), "column 'colour' is not known"),
        (lambda file: file["columns"].update(miss_m="3"), "a column is no list"),
        (lambda file: file["columns"].update(miss_m=[1.0]), "differ in length"),
        (lambda file: file["columns"].update(miss_m=[1.0, None, 2.0]), "has an unknown value"),
        (lambda file: file["columns"].update(miss_m=[1.0, "2", 2.0]), "that is no float"),
        (lambda file: file["columns"].update(miss_m=[1.0, True, 2.0]), "that is no float"),
        (lambda file: file["columns"].update(miss_m=[1.0, 1e300, 2.0]), "beyond"),
        (lambda file: file["columns"].update(run=[0, 1.5, 2]), "that is no int"),
        (lambda file: file["columns"].update(run=[0, 10**400, 2]), "beyond"),
        (lambda file: file["columns"].update(outcome=["arrived", "late", "arrived"]), "late"),
        (lambda file: file.update(burns_m_s=[1.0]), "burns_m_s must have one row"),
        (lambda file: file.update(b_plane_t_rad="x"), "could not convert"),
    ],
)
def test_damaged_file_is_refused(change: Change, reason: str, tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    save(simulate(load_scenario("asteroid-1997-single"), 3), file)
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))

    with pytest.raises(InputError, match=reason) as refused:
        load_results(file)
    assert str(refused.value).startswith(f"{file}: are not readable results: ")


def test_file_with_half_known_positions_is_refused(tmp_path: Path) -> None:
    """A position in space without y is not the position with y = 0."""
    file = tmp_path / "results.json"
    save(simulate(load_scenario("asteroid-1997-space"), 3), file)
    content = json.loads(file.read_text())
    content["columns"]["start_y_m"][1] = None
    file.write_text(json.dumps(content))

    with pytest.raises(InputError, match="column 'start_y_m' is unknown in some runs"):
        load_results(file)


@pytest.mark.parametrize("content", ["", "[", "[" * 100_000, "NaN", "{}", "\x00"])
def test_file_without_results_is_refused(content: str, tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    file.write_text(content)

    with pytest.raises(InputError, match="are not readable results"):
        load_results(file)


def test_pandas_gets_the_columns_with_their_units() -> None:
    results = simulate(load_scenario("asteroid-1997-single"), 3)

    frame = results.to_pandas()

    assert {name: frame[name].tolist() for name in ("run", "miss_m", "outcome")} == {
        name: results.to_dict()[name] for name in ("run", "miss_m", "outcome")
    }
    units = frame.attrs["units"]
    assert (units["miss_m"], units["start_vz_m_s"], units["outcome"]) == ("m", "m/s", "")
