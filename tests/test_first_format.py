"""Files of version 0.1.0, before bodies had a size, are read as before.

`data/first-format` has a campaign of 8 runs, a sweep of two cells and a record, whose outcomes have the old names.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from experiments import load_record
from experiments.interception.record_file import write_record
from experiments.interception.scenario_file import load_scenario
from sim import Body, Outcome
from sim.storage import CampaignFolder, scenario_hash

DATA = Path(__file__).parent / "data" / "first-format"
HASHES = {
    "asteroid-1997": "e80973301258094a",
    "asteroid-1997-single": "6969d050ac5e7cdd",
    "comet-fast": "2ecfe5574e67611c",
}


def test_fingerprints_of_scenarios_without_a_body_have_not_changed() -> None:
    assert {name: scenario_hash(load_scenario(name)) for name in HASHES} == HASHES


def test_a_campaign_is_read() -> None:
    folder = CampaignFolder.read(DATA / "campaign")
    assert folder.manifest.identity == "65410312226a367fb669b1c8c798a341"
    assert folder.manifest.scenario.body is None
    assert (folder.damaged, folder.complete) == ([], True)
    table = folder.table()
    outcomes = ["arrived", "arrived", "arrived", "set-empty", "set-empty", "arrived", "arrived", "arrived"]
    assert table.column("outcome").to_pylist() == outcomes
    assert table.column("hit").to_pylist() == [None] * 8
    emptied = [outcome == "set-empty" for outcome in outcomes]
    assert table.column("set_emptied").to_pylist() == emptied
    assert folder.numbers("set_emptied").tolist() == emptied
    np.testing.assert_allclose(folder.numbers("miss_m").max(), 509.2, atol=0.05)


def test_a_sweep_is_read() -> None:
    folder = CampaignFolder.read(DATA / "sweep")
    assert folder.manifest.identity == "5506555dd4c0c5bdc0acc8fd7977b3a0"
    assert (folder.damaged, folder.complete, folder.manifest.cells) == ([], True, 2)
    assert (
        folder.codes("outcome", ["arrived"], 0).tolist() == folder.codes("outcome", ["arrived"], 1).tolist() == [0] * 4
    )


def test_a_record_is_read_and_written_again(tmp_path: Path) -> None:
    record = load_record(DATA / "record.npz")
    assert record.result.outcomes == (Outcome.SET_EMPTY,)
    assert record.result.hit.mask.all()
    assert record.result.set_emptied.tolist() == [True]
    assert record.result.hits is None
    assert record.scenario.body is None
    write_record(record, tmp_path / "again.npz")
    again = load_record(tmp_path / "again.npz")
    assert again.result.outcomes == (Outcome.SET_EMPTY,)
    assert again.result.hit.mask.all()


def test_a_body_is_part_of_the_fingerprint() -> None:
    scenario = load_scenario("asteroid-1997")
    assert scenario_hash(replace(scenario, body=Body(80.0))) != scenario_hash(scenario)
