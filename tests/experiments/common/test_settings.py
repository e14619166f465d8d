"""``--set KEY=VALUE``: values in place of those of a file, checked like a file, in every command that takes one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import fields
from decimal import Decimal
from typing import Any

import pytest

from experiments.campaigns.command import Report
from experiments.cli import COMMANDS
from experiments.common.errors import InputError
from experiments.common.toml_file import load_tables
from experiments.interception.scenario_file import load_scenario
from experiments.pareto.file import FORM, load_pareto

Infoset = Callable[..., tuple[int, str, str]]


def test_every_command_that_takes_a_file_has_the_option() -> None:
    every: list[Any] = [options for rows in COMMANDS.values() for options, _, _ in rows]
    takes = [options for options in every if {"scenario", "problem"} & {each.name for each in fields(options)}]
    assert len(takes) >= 13
    assert [options for options in takes if "settings" not in {each.name for each in fields(options)}] == []
    assert "settings" not in {each.name for each in fields(Report)}


def test_values_are_replaced_in_the_units_of_the_file_and_named_in_the_description() -> None:
    scenario, before = (
        load_scenario("asteroid-1997", ["thruster.greatest_impulse_m_s=5"]),
        load_scenario("asteroid-1997"),
    )
    assert scenario.thruster.greatest_impulse_m_s == 5.0
    assert scenario.name == before.name
    assert scenario.description == f"{before.description}; with thruster.greatest_impulse_m_s = 5"
    tilted = load_scenario("asteroid-1997", ["uncertainty.x_km.least=5200", "dispersion.z_km=-8"])
    assert tilted.set_model.bounds.x_m == (5200e3, before.set_model.bounds.x_m[1])
    assert tilted.dispersion.z_m == (-8e3, -8e3)


def test_a_table_that_the_file_lacks_is_added() -> None:
    sensor = load_scenario("asteroid-1997", ["rate_sensor.period_s=1.0", "rate_sensor.error_rad_s=1e-6"]).rate_sensor
    assert sensor is not None
    assert sensor.error_rad_s == 1e-6
    with pytest.raises(InputError, match=r"with --set: rate_sensor\.error_rad_s: is missing"):
        load_scenario("asteroid-1997", ["rate_sensor.period_s=1.0"])


def test_text_needs_no_quotes_and_numbers_have_free_forms() -> None:
    changed = load_tables(FORM, "pareto-2008", ["name=my meeting", "duration_s=.5e2", 'free=["x"]', "meet=intercept"])
    assert (changed.name, changed.duration_s, len(changed.free)) == ("my meeting", Decimal(50), 1)
    assert changed.description.endswith('with name = my meeting, duration_s = .5e2, free = ["x"], meet = intercept')


def test_tables_of_an_array_are_numbered_from_1_as_in_messages() -> None:
    craft = load_pareto("pareto-2008", ["craft.3.weight=2.5", "craft.1.position_m=[1, 2, 3]"]).encounter.craft
    assert [each.weight for each in craft] == [1.0, 1.0, 2.5]
    assert craft[0].state[:3].tolist() == [1.0, 2.0, 3.0]
    with pytest.raises(InputError, match=r"craft\.4\.weight: the file has 3 of these tables"):
        load_pareto("pareto-2008", ["craft.4.weight=1"])


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("thruster.greatest_impulse=5", "did you mean thruster.greatest_impulse_m_s?"),
        ("budget_m_s=5", "did you mean thruster.budget_m_s?"),
        ("nonsense=5", "for the keys, see: infoset scenarios new FILE"),
        ("schema=2", "a scenario has no key"),
        ("angle_sensor.scale=2", "a scale is only for --vary of infoset sweep; set each error bound of the sensor"),
        ("thruster.budget_m_s=much", 'thruster.budget_m_s: must be a number, found "much"; write for example'),
        ('thruster.budget_m_s="5"', "write it without quotes"),
        ("information_set.model=guarantied", 'did you mean "guaranteed"?'),
        ("uncertainty.x_km.least=1e9", "uncertainty.x_km"),
        ("uncertainty.x_km.middle=1", "a scenario has no key"),
        ("thruster.budget_m_s=nan", "must be a finite number"),
        ("thruster.budget_m_s=1e99999999999999999999", "must be a finite number"),
        ("thruster.budget_m_s=1\nstep_s=2", "must be a number"),
        ("thruster.budget_m_s", "must be KEY=VALUE"),
        ("thruster.budget_m_s=" + "[" * 2000, "must be KEY=VALUE"),
        ("thruster.budget_m_s=" + "[" * 900, "must be a number"),
    ],
)
def test_mistakes_are_those_of_a_file_and_name_the_key(setting: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scenario("asteroid-1997", [setting])
    assert message in str(caught.value)


def test_a_key_is_set_once() -> None:
    with pytest.raises(InputError, match=r"name is set twice"):
        load_tables(FORM, "pareto-2008", ["name=a", " name = b"])


@pytest.mark.usefixtures("unrendered")
def test_the_recorded_scenario_is_the_changed_one(infoset: Infoset) -> None:
    options = ("--set", "thruster.greatest_impulse_m_s=3", "--json", "-", "--out", "runs", "--quiet")
    code, out, err = infoset("engage", "asteroid-1997", *options)
    assert (code, err) == (0, "")
    recorded = load_scenario("runs/scenario.toml")
    assert recorded.thruster.greatest_impulse_m_s == 3.0
    assert recorded == load_scenario("asteroid-1997", ["thruster.greatest_impulse_m_s=3"])
    assert max(abs(step["impulse_m_s"]) for step in json.loads(out)["steps"]) == 3.0


def test_a_file_is_mended_and_options_have_precedence(infoset: Infoset) -> None:
    code, out, _ = infoset("pareto", "--set", "duration_s=40", "--json", "-")
    assert code == 0
    assert json.loads(out)["meeting_time_s"] == 40.0
    code, _, err = infoset("reach", "--set", "bounds.control=0", "--quiet")
    assert code == 2
    assert err.startswith("error: rendezvous-2021 (built in) with --set: bounds.control: ")
