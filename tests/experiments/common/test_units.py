"""Units of what is shown: one choice for figures and pages."""

from __future__ import annotations

import pytest

from infoset.experiments.common.units import length_unit, time_unit


@pytest.mark.parametrize(
    ("size_m", "name", "shown"),
    [(2500.0, "m", 2500.0), (7e5, "km", 700.0), (4.2e7, "Mm", 42.0), (1.495978707e11, "au", 1.0)],
)
def test_length_has_the_unit_of_its_size(size_m: float, name: str, shown: float) -> None:
    unit, per_m = length_unit(size_m)
    assert unit == name
    assert size_m * per_m == pytest.approx(shown)


@pytest.mark.parametrize(
    ("span_s", "name", "shown"), [(9e3, "s", 9e3), (18e3, "h", 5.0), (864e4, "days", 100.0)]
)
def test_duration_has_the_largest_fitting_unit(span_s: float, name: str, shown: float) -> None:
    unit, per_s = time_unit(span_s)
    assert unit == name
    assert span_s * per_s == pytest.approx(shown)
