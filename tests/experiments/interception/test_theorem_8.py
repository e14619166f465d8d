"""The bound of Theorem 8 in tables, records and pages."""

from __future__ import annotations

from pathlib import Path

import pytest

from experiments.interception.page import interception_page
from experiments.interception.record_file import load_record
from tests.experiments.command_line import Command

LEAST_EFFORT = ("--model", "guaranteed", "--set", "strategy=least-effort")
START = ("uncertainty.x_km=[5801.3,5801.3]", "uncertainty.vx_km_s=[-58,-58]", "dispersion.x_km=5801.3")
KNOWN = tuple(word for value in (*START, "dispersion.vx_km_s=-58") for word in ("--set", value))


@pytest.mark.parametrize("command", [("engage",), ("experiment", "--runs", "2")])
def test_tables_show_it_where_range_and_speed_are_known(command: tuple[str, ...], infoset: Command) -> None:
    code, out, _ = infoset(*command, *LEAST_EFFORT, *KNOWN)
    assert code == 0
    assert "bound by Theorem 8, m" in out
    code, out, _ = infoset(*command, *LEAST_EFFORT)
    assert code == 0
    assert "Theorem 8" not in out


def test_record_and_page_hold_it(infoset: Command, tmp_path: Path) -> None:
    code, _, _ = infoset("engage", *LEAST_EFFORT, *KNOWN, "--record", tmp_path / "known.npz")
    assert code == 0
    record = load_record(tmp_path / "known.npz")
    (bound_m,) = record.result.theorem_8_miss_m.tolist()
    assert bound_m > record.result.miss_m[0]
    assert f'"theorem_8_miss_m":{bound_m!r}' in interception_page([record]).replace(": ", ":")
