"""Profiles of Hypothesis (fixed examples; other and more ones: `thorough`), and fixtures that many
tests use.
"""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, is_hypothesis_test, settings

from infoset.sim.scenario import of_model

if TYPE_CHECKING:
    from infoset.sim import Scenario

OF_THE_CHECKOUT = ["docs", "test_architecture.py", "test_readme.py"]
"""Tests of files that the wheel does not contain. They are skipped outside a checkout, where the
wheel is tested.
"""
IN_A_CHECKOUT = (Path(__file__).parents[1] / "README.md").exists()
collect_ignore = [] if IN_A_CHECKOUT else OF_THE_CHECKOUT

# One thread for linear algebra, set before NumPy is imported: the matrices are small, and the
# threads of several processes on the same cores would wait for each other by spinning.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

PROFILE = os.environ.get("INFOSET_HYPOTHESIS_PROFILE", "default")
TIMES = 32
EXAMPLES = 40
"""Examples of a property that sets no number; the profile `thorough` tries 3200."""

# No property depends on the speed of the machine.
settings.register_profile(
    "default",
    derandomize=True,
    deadline=None,
    max_examples=EXAMPLES,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile(
    "thorough",
    settings.get_profile("default"),
    derandomize=False,
    max_examples=TIMES * settings().max_examples,
)
settings.load_profile(PROFILE)


def pytest_configure() -> None:
    """Restore the default handler of SIGINT, which shells disable for background jobs; some tests
    send SIGINT.
    """
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile kernels before the workers of a run of all tests start."""
    config = session.config
    is_whole = config.args == [str(path) for path in config.getini("testpaths")]
    if is_whole and config.getoption("numprocesses", None) and not hasattr(config, "workerinput"):
        from tests.compiled_first import compile_first

        compile_first()


def pytest_report_header() -> str | None:
    """Name the skipped tests."""
    return None if IN_A_CHECKOUT else f"not a checkout; skipped: {', '.join(OF_THE_CHECKOUT)}"


def pytest_collection_modifyitems(items: Sequence[pytest.Item]) -> None:
    """Multiply also the examples of tests that set their number; a profile does not change
    those.
    """
    if PROFILE != "thorough":
        return
    tests = {id(item.obj): item.obj for item in items if isinstance(item, pytest.Function)}
    for test in tests.values():
        if not is_hypothesis_test(test):
            continue
        own: settings = test._hypothesis_internal_use_settings
        if own.max_examples != settings().max_examples:
            test._hypothesis_internal_use_settings = settings(
                own, max_examples=TIMES * own.max_examples
            )


def pytest_collection_finish() -> None:
    """Collect garbage less often, and not in the imported modules: it would take an eighth of the
    time of the tests.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000)


@pytest.fixture(autouse=True)
def environment_is_put_back() -> Iterator[None]:
    """Fail the test that leaves a changed environment variable, which could affect later tests."""
    before = dict(os.environ)
    yield
    after = dict(os.environ)
    for variables in (before, after):
        variables.pop("PYTEST_CURRENT_TEST", None)
    assert after == before


@pytest.fixture(scope="session", autouse=True)
def figures_are_small() -> Iterator[None]:
    """Write PNG files of 50 dpi, and PDF files with Type 3 fonts, which take a tenth of the time of
    the style's fonts.

    `experiments/common/test_figure_style.py` tests those of the style.
    """
    from infoset.experiments.common import figure_style

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            figure_style, "STYLE", [*figure_style.STYLE, {"pdf.fonttype": 3, "savefig.dpi": 50}]
        )
        yield


@pytest.fixture(scope="session", autouse=True)
def files_are_not_flushed() -> Iterator[None]:
    """Do not wait for the disk. Flushes are for a machine that stops, and cost milliseconds for
    each file.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda _descriptor: None)
        yield


@pytest.fixture(scope="session")
def brief() -> Scenario:
    """A short scenario with few sections: the last ten seconds of an approach with a known
    range.
    """
    from infoset import StateBox
    from infoset.experiments.interception.scenario_file import load_scenario
    from tests.sensors import linear

    published = load_scenario("asteroid-1997")
    box = StateBox((-100.0, 100.0), (590e3, 600e3), (-10.0, 10.0), (-58e3, -57.5e3))
    sensor = replace(linear(published.angle_sensor), nominal_range_m=595e3)
    model = replace(
        published.set_model, bounds=box, sections=5, fewest_sections=3, angle_sensor=sensor
    )
    return replace(
        published, name="brief", **of_model(model), dispersion=box, nominal_range_m=595e3
    )


@pytest.fixture(scope="session")
def brief_file(brief: Scenario, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of the scenario `brief`, in a separate folder."""
    from infoset.experiments.common.input_file import to_toml

    file = tmp_path_factory.mktemp("scenario") / "brief.toml"
    file.write_text(to_toml(brief))
    return file
