"""Tables on the screen: no number is cut off."""

from __future__ import annotations

import pytest

from infoset.experiments.common.screen import RowByRow, number


def test_row_by_row_prints_the_longest_numbers_whole(capsys: pytest.CaptureFixture[str]) -> None:
    values = (999999999.94, 100000000.0, 1.234e10, 1.234e-10)
    rows = RowByRow(("strategy", *"abcd"), ["patient"], quiet=False)
    rows.add("patient", *map(number, values))
    printed = capsys.readouterr().out.splitlines()[-1].split()
    assert printed == ["patient", "999999999.9", "100000000.0", "1.23e+10", "1.23e-10"]
