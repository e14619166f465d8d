"""The question of a mission analyst, as the README asks it."""

from __future__ import annotations

import itertools
import json
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
from infoset.sim import simulate
from infoset.sim.requirement import Decision, HitRequirement, judge
from infoset.sim.storage import CampaignFolder

Infoset = Callable[..., tuple[int, str, str]]
ROOT = Path(__file__).resolve().parents[3]
MORE = 50


def command(page: str) -> list[str]:
    """Return the arguments of the sweep on a page."""
    match = re.search(
        r"^infoset sweep (?:.*\\\n)*.*", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE
    )
    assert match is not None
    return shlex.split(match[0].replace("\\\n", ""))[1:]


@pytest.mark.skipif(not (ROOT / "docs").is_dir(), reason="the wheel has no pages")
def test_readme_and_page_have_the_same_question() -> None:
    asked = command("docs/requirements.md")
    assert asked == command("README.md")
    assert asked[asked.index("--require") + 1] == "hit>=0.95"


@pytest.mark.thorough
@pytest.mark.skipif(not (ROOT / "docs").is_dir(), reason="the wheel has no pages")
def test_the_answer_is_the_same_with_more_runs_in_each_cell(
    infoset: Infoset, tmp_path: Path
) -> None:
    asked = command("docs/requirements.md")
    code, out, _ = infoset(*asked, "--json", "-")
    assert code == 0
    report: Any = json.loads(out)
    folder = CampaignFolder.read(tmp_path / "requirement")
    scenario = folder.manifest.scenario
    axes = sweep_axes(
        ",".join(after for name, after in itertools.pairwise(asked) if name == "--vary"), scenario
    )
    assert folder.manifest.axes == axes
    required = HitRequirement(0.95)
    assert folder.manifest.until == str(required)
    decisions = []
    for number, cell in enumerate(sweep_cells(scenario, axes)):
        hits = folder.runs(["hit"], number)["hit"].to_numpy(np.float64)
        more = simulate(cell, range(hits.size, hits.size + MORE), guarantee=False)
        longer = np.concatenate([hits, more.hit.filled(False).astype(np.float64)])
        decision = judge(hits, required, watched=True).decision
        assert report["cells"][number]["requirement"] == decision.value
        if decision is not Decision.UNDECIDED:
            assert judge(longer, required, watched=True).decision is decision
            # Nor does the interval of all runs contradict the decision.
            assert judge(longer, required, watched=False).decision in (decision, Decision.UNDECIDED)
        decisions.append(decision)
    assert decisions.count(Decision.MET) > 20
    assert decisions.count(Decision.NOT_MET) > 20
    assert decisions.count(Decision.UNDECIDED) < 5
