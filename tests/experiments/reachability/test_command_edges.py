"""`infoset reach` at the edges: every problem has an answer or one message, and none of a library's own words."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from experiments.cli import main
from tests.built_in import problem_text

CASES = Path(__file__).parents[2] / "rendezvous" / "reachability" / "cases"

Infoset = Callable[..., tuple[int, str, str]]


@pytest.fixture
def reach(capsys: pytest.CaptureFixture[str]) -> Infoset:
    def run(*arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as left:
            main(["reach", *(str(each) for each in arguments)])
        captured = capsys.readouterr()
        for word in ("Traceback", "Qhull", "QH6", "Clarabel", "HiGHS", "Polytope"):
            assert word not in captured.err
        return int(left.value.code or 0), captured.out, captured.err

    return run


@pytest.mark.parametrize("name", ["s2_1_76", "s2_1_193", "s2_2_68", "near_0.1726"])
def test_problems_that_ended_in_a_traceback_or_a_refusal(reach: Infoset, name: str) -> None:
    code, out, err = reach(CASES / f"{name}.toml", "--json", "-", "--quiet")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert [each["name"] for each in found["controls"]] == ["energy", "l1", "norms", "peak", "chebyshev", "analytic"]
    if name == "s2_2_68":
        assert found["optimal_miss"] == pytest.approx(679.084, abs=5e-4)


@pytest.mark.parametrize("route", ["auto", "exact", "lifted"])
@pytest.mark.parametrize("bound", ["0.115", "0.15"])
def test_the_published_problem_with_less_thrust(reach: Infoset, tmp_path: Path, bound: str, route: str) -> None:
    file = tmp_path / "less.toml"
    file.write_text(problem_text("rendezvous-2021").replace("control = 1.0", f"control = {bound}"))
    assert f"control = {bound}" in file.read_text()
    code, out, err = reach(file, "--route", route, "--json", "-", "--quiet")
    assert (code, err) == (0, "")
    if bound == "0.15":
        assert json.loads(out)["optimal_miss"] == pytest.approx(1.62757318, abs=1e-8)


def test_a_frozen_model_that_amplifies_rounding_is_refused(reach: Infoset) -> None:
    ellipse = ("--set", "orbit.eccentricity=0.9", "--set", "orbit.semi_major_axis_km=65000")
    code, out, err = reach("rendezvous-2021", *ellipse, "--set", "periods=40", "--set", "period_s=1000")
    assert (code, out) == (2, "")
    assert "the linear model multiplies deviations by over 1e+10" in err


def test_too_many_vertices(reach: Infoset) -> None:
    code, out, err = reach(CASES / "s4_1_59.toml", "--select", "vertices", "--quiet")
    assert (code, out) == (2, "")
    assert err.startswith(
        "error: --select vertices: the optimal controls have 22875 vertices, more than the limit of 2000"
    )
    assert "--select samples:20" in err
