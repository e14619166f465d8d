"""The reference lists what is public."""

from __future__ import annotations

import re
from pathlib import Path

from infoset import experiments

REFERENCE = Path(__file__).resolve().parents[2] / "docs" / "reference"


def test_the_page_of_experiments_lists_its_public_names() -> None:
    page = (REFERENCE / "experiments.md").read_text(encoding="utf-8")
    assert (
        sorted(
            re.findall(
                r"^\.\. auto(?:function|exception):: infoset\.experiments\.(\w+)$",
                page,
                re.MULTILINE,
            )
        )
        == experiments.__all__
    )
