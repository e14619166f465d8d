"""What the package offers."""

from __future__ import annotations

import infoset


def test_the_listed_names_are_those_that_the_package_offers() -> None:
    assert dir(infoset) == sorted(infoset.__all__)
    assert {"LinearObserver", "Polytope", "InformationSet"} <= {*dir(infoset)}  # the first two are imported when used
    assert all(hasattr(infoset, name) for name in dir(infoset))
