"""Files of a form: arrays of tables, kinds, and what is said of what is wrong in them."""

from __future__ import annotations

from decimal import Decimal
from typing import Annotated

import pytest
from pydantic import Field, PlainValidator

from experiments.common.errors import InputError, shown
from experiments.common.problem_file import problem_form, problem_hash
from experiments.common.toml_file import read_tables
from experiments.common.toml_form import Known
from experiments.common.toml_values import NUMBER, Name, Numbers, Positive, Table, Vector, key


class CraftTable(Table):
    name: Name = key("what it is called", '"A"')
    position_m: Vector = key("where it is", "[1.0, 2.0, 3.0]")
    bound: Annotated[tuple[Decimal, ...], PlainValidator(Numbers(3, NUMBER, one_for_all=True))] = key(
        "a number or one an axis", "1.0", default=(Decimal(1),) * 3
    )


class OrbitTable(Table):
    rate_rad_s: Positive = key("its rate", "1e-3")


class MeetingTables(Table):
    schema_number: int = key("version", "1", alias="schema", default=1)
    kind: str = key("what it is", '"meeting"')
    name: Name = key("what it is called", '"mine"', default="mine")
    orbit: OrbitTable = key("the orbit", "")
    craft: Annotated[list[CraftTable], Field(min_length=1, max_length=3)] = key("who meets", "")


FORM = problem_form("meeting", MeetingTables)
GOOD = """
kind = "meeting"
[orbit]
rate_rad_s = 1e-3
[[craft]]
name = "A"
position_m = [1.0, 2, 3e3]
[[craft]]
name = "B"
position_m = [0, 0, 0]
bound = 2
"""


def message(text: str) -> str:
    """What is said of an unsound text."""
    with pytest.raises(InputError) as caught:
        read_tables(FORM, text, "mine.toml")
    return str(caught.value)


def test_values_come_as_they_were_written() -> None:
    tables = read_tables(FORM, GOOD, "mine.toml")
    assert tables.craft[0].position_m == (Decimal("1.0"), Decimal(2), Decimal("3e3"))
    assert tables.craft[1].bound == (Decimal(2),) * 3
    assert problem_hash(tables) == problem_hash(read_tables(FORM, f'name = "other"\n{GOOD}', "other.toml"))
    assert problem_hash(tables) != problem_hash(read_tables(FORM, GOOD.replace("bound = 2", "bound = 3"), "mine.toml"))


@pytest.mark.parametrize(
    ("wrong", "right", "said"),
    [
        ("bound = 2", 'bound = "2"', "craft #2.bound: must be a number or an array of 3 numbers, found"),
        ("[0, 0, 0]", "[0, 0]", "craft #2.position_m: must be an array of 3 numbers, not 2"),
        ("[0, 0, 0]", "[0, nan, 0]", "craft #2.position_m: number 2 of the array must be a finite number"),
        ("bound = 2", "bonud = 2", "craft #2.bonud: is not a key of [[craft]]; did you mean bound?"),
        ('name = "B"', "", "craft #2.name: is missing; add it under [[craft]], for example name"),
        ("rate_rad_s = 1e-3", "", "orbit.rate_rad_s: is missing; add it under [orbit], for example rate_rad_s = 1e-3"),
        ("bound = 2", "rate_rad_s = 2", "craft #2.rate_rad_s: is not a key of [[craft]]; move rate_rad_s to [orbit]"),
        ('kind = "meeting"', "", 'kind: is missing; write kind = "meeting" above the first table'),
        ('kind = "meeting"', 'kind = "tour"', 'kind: must be "meeting", found "tour"'),
        ('kind = "meeting"', 'kind = "meeting"\ncraft = 3', "is not valid TOML"),
    ],
)
def test_what_is_wrong_is_named_with_its_place(wrong: str, right: str, said: str) -> None:
    assert wrong in GOOD
    assert said in message(GOOD.replace(wrong, right))


def test_arrays_of_tables_have_limits() -> None:
    first = GOOD.index("[[craft]]")
    assert "[[craft]]" in message(GOOD[:first])
    assert "must be tables, found 3; write [[craft]]" in message(f"craft = 3\n{GOOD[:first]}")
    assert "craft: must have at most 3 of them, found 4" in message(GOOD + GOOD[first:])


def test_values_that_are_sound_are_known_by_their_path() -> None:
    known = Known({"craft": [{"name": "A"}, {"name": 3}]}, frozenset({("craft", "1", "name")}))
    assert known.value("craft", "0", "name") == "A"
    assert known.value("craft", "1", "name") is None
    assert known.value("craft", "2", "name") is None
    assert shown(known.value("craft")) == "[a table, a table]"
