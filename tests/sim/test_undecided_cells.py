from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.sim import Campaign, CampaignNoise, QuantileName, Requirement, RunsUntil, Scenario
from infoset.sim.requirement import Decision, judge
from infoset.sim.scenario import of_model
from infoset.sim.storage import Axis, CampaignFolder, read_manifest
from tests.sensors import linear
from tests.sim.shuffled import Shuffled

ERRORS = (1e-5, 1.2e-4, 1.5e-4, 3e-4)
REQUIRED = Requirement(QuantileName("miss_m", 0.8), 3.0)


class InterruptError(Exception):
    """Stands for an interruption."""


@pytest.fixture(scope="module")
def asked(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    sensor = linear(brief.angle_sensor)
    cells = tuple(
        replace(
            brief,
            **of_model(
                replace(
                    brief.set_model, angle_sensor=replace(sensor, error_at_zero_range_rad=error)
                )
            ),
        )
        for error in ERRORS
    )
    axis = Axis("angle_sensor.error_at_zero_range_rad", ERRORS)
    folder = tmp_path_factory.mktemp("undecided") / "sweep"
    return Campaign(
        brief,
        RunsUntil(REQUIRED, max_runs=160, min_runs=16),
        folder,
        seed=3,
        noise=CampaignNoise.MIXED,
        guarantee=False,
        chunk=16,
        axes=(axis,),
        cells=cells,
    )


@pytest.fixture(scope="module")
def flown(asked: Campaign) -> CampaignFolder:
    """The sweep, simulated by one thread without an interruption."""
    return asked.run(workers=1)


def names(folder: Path | str) -> list[str]:
    return sorted(file.name for file in (Path(folder) / "shards").glob("*.parquet"))


def samples(folder: CampaignFolder, cell: int) -> list[np.ndarray[Any, Any]]:
    runs = folder.runs(["noise", "miss_m"], cell)
    return [runs["miss_m"][runs["noise"] == noise].to_numpy() for noise in ("random", "game")]


def test_cells_stop_when_they_are_decided(flown: CampaignFolder) -> None:
    assert flown.complete
    assert flown.manifest.until == "miss_m p80<3"
    runs = flown.manifest.cell_runs
    assert len(set(runs)) > 1
    assert flown.finished_runs == flown.wanted_runs == sum(runs)
    for cell, size in enumerate(runs):
        values = samples(flown, cell)
        assert sum(sample.size for sample in values) == size
        verdicts = [judge(sample, REQUIRED, watched=True) for sample in values]
        decided = [verdict.decision is not Decision.UNDECIDED for verdict in verdicts]
        assert all(decided) or size == 160
        if size > 16:
            before = [
                judge(sample[: sample.size - 8], REQUIRED, watched=True).decision
                for sample in values
            ]
            assert Decision.UNDECIDED in before


def test_the_runs_of_a_cell_are_those_of_a_longer_sweep(
    asked: Campaign, flown: CampaignFolder, tmp_path: Path
) -> None:
    whole = replace(asked, runs=160, folder=tmp_path / "whole").run()
    for cell, size in enumerate(flown.manifest.cell_runs):
        assert flown.runs(cell=cell).equals(whole.runs(cell=cell)[:size])


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(each, marks=pytest.mark.thorough) for each in (2, 3))]
)
def test_neither_workers_nor_interruptions_change_what_is_stored(
    seed: int, asked: Campaign, flown: CampaignFolder, tmp_path: Path
) -> None:
    again = replace(asked, folder=tmp_path / "again")

    def interrupt_after(chunks: int) -> Callable[[float], None]:
        calls = itertools.count(1)

        def progress(_: float) -> None:
            if next(calls) >= chunks:
                raise InterruptError

        return progress

    for _ in range(3):
        with pytest.raises(InterruptError):
            again.run(Shuffled(seed), workers=5, resume=True, progress=interrupt_after(seed))
        assert not CampaignFolder.read(tmp_path / "again").complete
    result = again.run(Shuffled(seed), workers=5, resume=True)
    assert names(tmp_path / "again") == names(asked.folder)
    assert result.manifest.cell_runs == flown.manifest.cell_runs
    again.run(resume=True, progress=interrupt_after(1))  # simulates nothing


def test_a_sweep_of_fixed_runs_is_continued_until_it_is_decided(
    asked: Campaign, flown: CampaignFolder, tmp_path: Path
) -> None:
    for runs in (16, 10):
        folder = tmp_path / f"{runs}"
        fixed = replace(asked, runs=runs, folder=folder).run()
        assert fixed.finished_runs == runs * len(ERRORS)
        replace(asked, folder=folder).run(resume=True)
        assert names(folder) == names(asked.folder)
        assert read_manifest(folder).cell_runs == flown.manifest.cell_runs


@pytest.mark.thorough
def test_more_runs_in_each_cell_change_no_decision(
    asked: Campaign, flown: CampaignFolder, tmp_path: Path
) -> None:
    most = max(flown.manifest.cell_runs)
    runs = RunsUntil(REQUIRED, max_runs=160, min_runs=most)
    longer = replace(asked, runs=runs, folder=tmp_path / "longer").run()
    assert set(longer.manifest.cell_runs) == {most}
    for cell in range(len(ERRORS)):
        for short, long in zip(samples(flown, cell), samples(longer, cell), strict=True):
            decision = judge(short, REQUIRED, watched=True).decision
            assert decision in (Decision.UNDECIDED, judge(long, REQUIRED, watched=True).decision)


def test_campaign_with_incompatible_arguments_is_refused(asked: Campaign) -> None:
    with pytest.raises(ValueError, match="max_runs must be at least 16"):
        RunsUntil(REQUIRED, max_runs=15, min_runs=16)
    with pytest.raises(ValueError, match="cell_runs must contain 4 numbers"):
        replace(asked.manifest(), cell_runs=(1, 2))
