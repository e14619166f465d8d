"""How many examples Hypothesis tries: few by default, twenty times as many under the profile `thorough`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import pytest
from hypothesis import is_hypothesis_test, settings

OF_THE_CHECKOUT = ["docs", "test_architecture.py", "test_readme.py"]
"""Tests of files that no wheel holds: left out where there are none, so that the others can run against a wheel."""
IN_A_CHECKOUT = (Path(__file__).parents[1] / "README.md").exists()
collect_ignore = [] if IN_A_CHECKOUT else OF_THE_CHECKOUT

PROFILE = os.environ.get("INFOSET_HYPOTHESIS_PROFILE", "default")
TIMES = 20

settings.register_profile("thorough", max_examples=TIMES * settings().max_examples, deadline=None)
settings.load_profile(PROFILE)


def pytest_report_header() -> str | None:
    """Say what is left out."""
    return None if IN_A_CHECKOUT else f"no checkout here: left out {', '.join(OF_THE_CHECKOUT)}"


def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """Multiply the examples of those tests too that say how many they want: a profile alone leaves them as they are."""
    if PROFILE != "thorough":
        return
    tests = {id(item.obj): item.obj for item in items if isinstance(item, pytest.Function)}
    for test in tests.values():
        if not is_hypothesis_test(test):
            continue
        own: settings = test._hypothesis_internal_use_settings
        if own.max_examples != settings().max_examples:
            test._hypothesis_internal_use_settings = settings(own, max_examples=TIMES * own.max_examples)
