from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest

Check = Callable[[int], None]


@pytest.fixture
def check_seeds() -> Callable[[Check, Iterable[int]], None]:
    """Runs a check for all seeds, and reports the errors of those that fail together."""

    def run(check: Check, seeds: Iterable[int]) -> None:
        failed = {}
        for seed in seeds:
            try:
                check(seed)
            except (AssertionError, ValueError, RuntimeError, RuntimeWarning) as error:
                failed[seed] = str(error).splitlines()[:3]
        assert not failed

    return run
