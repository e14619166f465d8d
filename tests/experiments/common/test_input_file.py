from __future__ import annotations

import dataclasses
import random
import tomllib
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.experiments.common.built_in_files import SCENARIO, built_in_files
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import (
    changed,
    load_problem,
    parse,
    read_file,
    read_text,
    to_toml,
)
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.sim import Scenario
from tests.built_in import problem_text, scenario_text

TEXT = scenario_text("asteroid-1997")

MISTAKES = {
    "missing": ("step_s = 0.5 ", "", "mine.toml: step_s: is missing"),
    "misspelt": (
        "distance_km",
        "distnce_km",
        "mine.toml: sun.distnce_km: is not a known key; did you mean distance_km?",
    ),
    "negative": (
        "distance_km = 150.0e6",
        "distance_km = -150.0e6",
        "mine.toml: sun.distance_km: must be greater than 0, found -1.500e+8",
    ),
    "text for a number": (
        "step_s = 0.5",
        'step_s = "0.5"',
        'mine.toml: step_s: must be a valid number, found "0.5"',
    ),
    "reversed pair": (
        "z_km = [-10.0, 10.0]",
        "z_km = [10.0, -10.0]",
        (
            "mine.toml: uncertainty.z_km: must be a pair [minimum, maximum], and is reversed, "
            "found [10.0, -10.0]"
        ),
    ),
    "unknown table": (
        "[range_sensor]",
        "[radar]",
        (
            "mine.toml: radar: is not a known key; the tables are sun, uncertainty, dispersion, "
            "covariance, angle_sensor, camera, range_sensor, rate_sensor, wrong_images, "
            "wrong_ranges, target, body, thruster, information_set"
        ),
    ),
    "wrong unit": (
        "distance_km",
        "distance_deg",
        (
            "mine.toml: sun.distance_deg: is not a known key; did you mean distance_m? It can end "
            "in m, km, au"
        ),
    ),
    "two units of one key": (
        "direction_deg = 90.0",
        "direction_deg = 90.0\ndirection_rad = 1.57",
        "mine.toml: sun.direction_deg: is written again, as direction_rad, found 90.0",
    ),
    "beyond a limit in another unit": (
        "direction_deg = 90.0",
        "direction_deg = 900.0",
        "mine.toml: sun.direction_deg: must be at most 6.28319 (in rad), found 900.0",
    ),
    "not a number": (
        "step_s = 0.5",
        "step_s = nan",
        "mine.toml: step_s: must be a finite number, found nan",
    ),
    "bool": (
        "step_s = 0.5",
        "step_s = true",
        "mine.toml: step_s: must be a valid number, found true",
    ),
    "wrong kind of file": (
        TEXT,
        problem_text("service-2"),
        "mine.toml: this is a problem of kind multipoint; use infoset multipoint FILE",
    ),
    "not TOML": (
        "step_s = 0.5",
        "step_s 0.5",
        (
            "mine.toml: is not valid TOML: Expected '=' after a key in a key/value pair (at line "
            "7, column 8)"
        ),
    ),
    "no such choice": (
        'noise = "random"',
        'noise = "rndom"',
        "mine.toml: noise: must be 'random', 'gaussian', 'correlated' or 'game', found \"rndom\"",
    ),
}
"""Old and new text of a file, and the message."""


@pytest.mark.parametrize("mistake", MISTAKES)
def test_each_mistake_in_a_file_has_one_message(mistake: str) -> None:
    old, new, message = MISTAKES[mistake]
    with pytest.raises(InputError) as caught:
        read_text(Scenario, TEXT.replace(old, new, 1), "mine.toml")
    assert str(caught.value) == message


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "thruster.budgt_m_s=5",
            'has no key "thruster.budgt_m_s"; did you mean thruster.budget_m_s?',
        ),
        (
            "thruster.budget_m_s",
            'must be KEY=VALUE, found "thruster.budget_m_s"; for example --set name=mine',
        ),
        ("step_s.min=1", 'has no key "step_s.min"'),
        ("rate_sensor.period_s=1", "rate_sensor.error_rad_s: is missing"),
        ("uncertainty.x_km.min=[1, 2]", "uncertainty.x_km.min: must be a number, found [1, 2]"),
        (
            "dispersion.z_km.max=-5",
            "dispersion.z_km: must be a pair [minimum, maximum], and is reversed",
        ),
    ],
)
def test_each_wrong_setting_has_one_message(setting: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scenario("asteroid-1997", [setting])
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_all_mistakes_of_a_file_are_listed() -> None:
    names = ("misspelt", "reversed pair", "bool", "wrong unit")
    text = TEXT
    for name in names[:3]:
        text = text.replace(*MISTAKES[name][:2], 1)
    with pytest.raises(InputError) as caught:
        read_text(Scenario, text, "mine.toml")
    assert sorted(str(caught.value).splitlines()) == sorted(MISTAKES[name][2] for name in names[:3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a = " + "[\n" * 2000, "is not valid TOML: it is nested too deeply"),
        ("a" * 2000, "is not valid TOML: Expected '=' after a key"),
        ("name = 1\n[" + "a." * 25_000 + "a]", "mine.toml: line 2: a key has more than 20 parts"),
        ("a = 1979-05-27", "a: is not a known key"),
        ('name = "\\u001b[31m"', "name: must be one line without control characters"),
        ('name = "../mine"', "name: must begin with a letter or a digit"),
        ("step_s = 1e400", "step_s: must be a finite number"),
        ("angle_sensor.period_s = 0", "angle_sensor.period_s: must be greater than 0"),
    ],
)
def test_hostile_files_are_refused_with_short_lines(text: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        read_text(Scenario, text, "mine.toml")
    assert message in str(caught.value)
    assert max(map(len, str(caught.value).splitlines())) < 250
    assert str(caught.value).replace("\n", "").isprintable()


@pytest.mark.parametrize("content", [b"", b"\xff\xfe", b"PK\x03\x04", b"x" * 200_000])
def test_binary_file_is_refused(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_bytes(content)
    with pytest.raises(InputError, match=r"mine\.toml: "):
        read_file(Scenario, tmp_path / "mine.toml")


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("distance_au", "1.0"),
        ("distance_m", "149597870700.0"),
        ("distance_km", "149597870.7"),
        ("distance_km", "149597870700e-3"),
    ],
)
def test_a_key_is_written_in_any_unit_and_rounded_once(key: str, value: str) -> None:
    text = TEXT.replace("distance_km = 150.0e6", f"{key} = {value}")
    sun = read_text(Scenario, text, "mine.toml").sun
    assert sun is not None
    assert sun.distance_m == 149597870700.0


def test_a_number_is_both_ends_of_an_interval() -> None:
    assert load_scenario("asteroid-1997", ["uncertainty.x_km=5801.3"]).uncertainty.x_m == (
        5801300.0,
        5801300.0,
    )


def test_settings_are_in_any_unit_and_named_in_the_description() -> None:
    scenario = load_scenario("asteroid-1997", ["thruster.budget_km_s=.5"])
    before = load_scenario("asteroid-1997")
    assert scenario.thruster.budget_m_s == 500.0
    assert scenario.description == f"{before.description}; with thruster.budget_km_s=.5"
    tilted = load_scenario("asteroid-1997", ["uncertainty.x_km.min=5200", "dispersion.z_km=-8"])
    assert tilted.uncertainty.x_m == (5200e3, before.uncertainty.x_m[1])
    assert tilted.dispersion.z_m == (-8e3, -8e3)
    sensor = load_scenario(
        "asteroid-1997", ["rate_sensor.period_s=1.0", "rate_sensor.error_rad_s=1e-6"]
    ).rate_sensor
    assert sensor is not None
    assert sensor.error_rad_s == 1e-6


def test_tables_of_an_array_are_numbered_from_1() -> None:
    problem = load_problem(
        "pareto-2008", ["craft.3.weight=2.5", "craft.1.position_m=[1, 2, 3]", "name=my meeting"]
    )
    assert [each.weight for each in problem.craft] == [1.0, 1.0, 2.5]
    assert problem.craft[0].position_m == (1.0, 2.0, 3.0)
    assert problem.name == "my meeting"
    for number in ("4", "0", "0000012", "\u00b2"):
        with pytest.raises(InputError, match=rf'has no key "craft\.{number}\.weight"'):
            load_problem("pareto-2008", [f"craft.{number}.weight=2.5"])


def test_changed_checks_as_a_file() -> None:
    scenario = load_scenario("asteroid-1997")
    other = changed(
        scenario, {"thruster.budget_m_s": 0.1 + 0.2, "information_set.sections": 31}, "cell"
    )
    assert (other.thruster.budget_m_s, other.information_set.sections) == (0.1 + 0.2, 31)
    assert (
        changed(other, {"thruster.budget_m_s": 1000.0, "information_set.sections": 29}, "cell")
        == scenario
    )
    with pytest.raises(InputError, match=r"cell: thruster\.budget_m_s: must be at least 0"):
        changed(scenario, {"thruster.budget_m_s": -1.0}, "cell")


def test_a_name_wins_over_a_file_and_a_path_over_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "comet-fast").write_text(TEXT)
    assert load_scenario("comet-fast").name == "comet-fast"
    assert load_scenario("./comet-fast").name == "asteroid-1997"
    with pytest.raises(
        InputError, match=r'built-in scenario: there is no "commet-fast"; did you mean comet-fast\?'
    ):
        load_scenario("commet-fast")
    with pytest.raises(InputError, match=r"mine\.toml: cannot be read: No such file"):
        load_scenario("mine.toml")


def with_numpy_numbers(value: Any) -> Any:
    """Return a dataclass, or a tuple of values, with all numbers as NumPy's."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [field.name for field in dataclasses.fields(value)]
        return dataclasses.replace(
            value, **{name: with_numpy_numbers(getattr(value, name)) for name in names}
        )
    if isinstance(value, tuple):
        return tuple(map(with_numpy_numbers, value))
    if isinstance(value, bool):
        return value
    if isinstance(value, float):
        return np.float64(value)
    return np.int64(value) if isinstance(value, int) else value


@pytest.mark.parametrize("name", built_in_files())
def test_numbers_of_numpy_are_written_as_numbers(name: str) -> None:
    file = built_in_files()[name]
    value: Any = load_scenario(name) if file.kind == SCENARIO else load_problem(name)
    same = with_numpy_numbers(value)

    assert same == value
    assert to_toml(same) == to_toml(value)
    assert read_text(type(value), to_toml(same), name) == value


def test_the_largest_number_is_written_where_it_is_not_the_default() -> None:
    scenario = load_scenario("dart-2022")
    thruster = dataclasses.replace(scenario.thruster, budget_m_s=1e60)
    large = dataclasses.replace(scenario, thruster=thruster)

    assert read_text(Scenario, to_toml(large), "file") == large


def test_numpy_numbers_become_python_numbers_in_a_scenario() -> None:
    scenario = with_numpy_numbers(load_scenario("dart-2022"))

    assert type(scenario.step_s) is float
    assert type(scenario.information_set.sections) is int
    assert {type(number) for number in scenario.dispersion.x_m} == {float}
    assert repr(scenario) == repr(load_scenario("dart-2022"))


def test_changed_number_of_numpy_is_written_as_a_number() -> None:
    scenario = changed(
        load_scenario("dart-2022"), {"step_s": np.float64(120.0), "camera.period_s": 120.0}, "test"
    )
    assert scenario.step_s == 120.0


PARTS = ("a", "k-1", "'x.y'", '"p.q \\" # ="', '""')
VALUES = (
    "1.5",
    "-2e-3",
    "true",
    "1979-05-27T07:32:00.5Z",
    '"' + "a." * 30 + '"',
    "'" + "a . " * 30 + "'",
    '"""' + "a." * 30 + '\n"quoted" \\""" . ""\n"""',
    "'''" + "a." * 30 + "\n# 'x'\n'''",
    "[" + "1.25, " * 300 + "]",
    "[ # " + "a." * 30 + "\n 1.0,\n 2.0 ]",
    "{x = 1.0, 'y' = [2.0, 3.0]}",
)
"""Values that have many points and no long key."""


def random_document(draw: random.Random, most_parts: int) -> tuple[str, int]:
    """Return a TOML text, and the number of parts of its longest key."""
    lines = []
    longest = 1
    for place in range(draw.randint(1, 8)):
        count = draw.randint(1, most_parts)
        longest = max(longest, count)
        point = draw.choice((".", " . ", ".\t"))
        # The first part is a name of its own, so that no key is written twice.
        key = point.join([f"k{place}", *(draw.choice(PARTS) for _ in range(count - 1))])
        value = draw.choice(VALUES)
        lines.append(draw.choice((f"{key} = {value}", f"k{place} = {{{key} = 1.0}}", f"[{key}]")))
        if lines[-1].startswith("k"):
            lines.insert(0, lines.pop())
    return "\n".join(lines), longest


def test_only_keys_of_many_parts_are_refused_before_they_are_parsed() -> None:
    draw = random.Random(4)
    refused = 0
    for _ in range(1000):
        text, longest = random_document(draw, draw.choice((3, 20, 24)))
        if longest > 20:
            refused += 1
            with pytest.raises(InputError, match=r"line \d+: a key has more than 20 parts"):
                parse(text, "mine.toml")
        else:
            assert parse(text, "mine.toml") == tomllib.loads(text, parse_float=Decimal)
    assert 100 < refused < 500


def test_long_array_on_one_line_is_read() -> None:
    times_s = [round(99.5 - 0.5 * place, 1) for place in range(190)]
    line = f"impulses_s = {times_s}"
    assert len(line) > 1000
    scenario = read_text(Scenario, TEXT.replace("[thruster]", f"[thruster]\n{line}"), "mine.toml")
    assert scenario.thruster.impulses_s == tuple(times_s)


def test_a_setting_with_a_key_of_many_parts_is_refused() -> None:
    setting = "thruster.budget_m_s={" + "a." * 25 + "a = 1}"
    with pytest.raises(InputError, match=r"thruster\.budget_m_s: must be a"):
        load_scenario("asteroid-1997", [setting])
