"""The papers whose numbers are reproduced: one module per paper computes them."""

from __future__ import annotations

from importlib import import_module

from experiments.common.published_number import Progress, Reproduction

PAPERS = ("interception", "pareto", "multipoint", "reachability", "pursuit")


def reproduce_paper(name: str, progress: Progress) -> Reproduction:
    """Compute the numbers of a paper of `PAPERS`; `progress` receives the fraction done."""
    reproduction = import_module(f"experiments.{name}.published").reproduce(progress)
    assert isinstance(reproduction, Reproduction)
    return reproduction
