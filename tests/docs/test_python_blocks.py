"""Every Python block in the prose runs; the blocks of a page share one namespace, in their
order.
"""

from __future__ import annotations

import ast
import doctest
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

pytestmark = pytest.mark.docs

if TYPE_CHECKING:
    from tests.docs.conftest import Page

REDUCED = ((r"\bruns=[\d_]+", "runs=4"),)
"""Substitutions that reduce blocks before they are run."""


def run_blocks(page: Page) -> None:
    """Run the blocks of a page."""
    namespace: dict[str, Any] = {"__name__": "__main__"}
    for block in page.blocks("python"):
        if block.not_run:
            continue
        text = block.text
        for pattern, small in REDUCED:
            text = re.sub(pattern, small, text)
        exec(compile(ast.parse(text), page.name, "exec"), namespace)


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Use a separate folder for the output of blocks."""
    monkeypatch.chdir(tmp_path)


def test_blocks_run(page: Page) -> None:
    run_blocks(page)


def test_sessions_print_their_documented_output(page: Page) -> None:
    for block in page.blocks("pycon"):
        test = doctest.DocTestParser().get_doctest(block.text, {}, page.name, page.name, 0)
        result = doctest.DocTestRunner().run(test)
        assert result.attempted > 0
        assert result.failed == 0
