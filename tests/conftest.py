"""How many examples Hypothesis tries: few by default, twenty times as many under the profile `thorough`."""

from __future__ import annotations

import os
from collections.abc import Sequence

import pytest
from hypothesis import is_hypothesis_test, settings

PROFILE = os.environ.get("INFOSET_HYPOTHESIS_PROFILE", "default")
TIMES = 20

settings.register_profile("thorough", max_examples=TIMES * settings().max_examples, deadline=None)
settings.load_profile(PROFILE)


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
