"""Outputs that pages print are those of the commands above them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.experiments.command_line import Command

if TYPE_CHECKING:
    from tests.docs.conftest import Page

pytestmark = pytest.mark.docs

REACH = "docs/guaranteed-rendezvous.md"


@pytest.fixture
def infoset(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> Command:
    """Run a command in this process, in an empty folder: exit code, stdout and stderr."""
    return Command.in_folder(tmp_path, capsys, monkeypatch)


def text_of(pages: list[Page], name: str) -> str:
    """Return the text of a page."""
    (page,) = (page for page in pages if page.name == name)
    return page.text


def test_guarantees_of_the_arch_rendezvous_are_those_of_the_page(
    infoset: Command, pages: list[Page]
) -> None:
    code, out, _ = infoset("reach", "approach-guaranteed")

    assert code == 0
    # The other numbers depend on the solver's choice of a plan.
    assert "\n".join(out.splitlines()[:6]) in text_of(pages, REACH)
