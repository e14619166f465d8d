"""The built-in files."""

from __future__ import annotations

from infoset.experiments.common.built_in_files import PROBLEMS, SCENARIO, built_in, built_in_names


def scenario_names() -> tuple[str, ...]:
    return tuple(built_in_names([SCENARIO]))


def scenario_text(name: str) -> str:
    return built_in(name, [SCENARIO]).text


def problem_text(name: str) -> str:
    return built_in(name, PROBLEMS).text
