"""`infoset scenarios` and `infoset problems`, and files of another kind."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from infoset.experiments.common.built_in_files import SCENARIO, built_in_files
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import read_input, read_text, to_toml
from infoset.sim.storage.codec import fingerprint
from tests.experiments.command_line import Command
from tests.fuzzing.subjects import text_files

FILES = built_in_files()
MINE = {"scenarios": "own-scenario", "problems": "service-2"}

FACTS = [
    "flight",
    "images",
    "possible impulses",
    "true arrival",
    "miss without impulses",
    (
        "miss that the images and the speeds of [uncertainty] leave possible, with errors at "
        "their bounds"
    ),
]
CAMERA_FACT = "miss that the images alone leave possible, with errors at their bounds (closed form)"


@pytest.mark.parametrize("noun", MINE)
def test_list_has_every_built_in_file(noun: str, infoset: Command) -> None:
    files = [file for file in FILES.values() if (file.kind == SCENARIO) == (noun == "scenarios")]
    names = [file.name for file in files]
    code, out, err = infoset(noun)
    assert (code, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()[1:] if not line.startswith(" ")] == names
    assert infoset(noun, "list") == (0, out, "")


@pytest.mark.parametrize("name", FILES)
def test_a_built_in_file_is_shown_copied_checked_and_written_again(
    name: str, infoset: Command
) -> None:
    file = FILES[name]
    noun = "scenarios" if file.kind == SCENARIO else "problems"
    assert infoset(noun, "show", name) == (0, file.text, "")
    assert infoset(noun, "new", "-", "--like", name)[:2] == (0, file.text)
    assert infoset(noun, "new", "mine.toml", "--like", name)[0] == 0
    copy, original = (
        text.splitlines() for text in (Path("mine.toml").read_text(encoding="utf-8"), file.text)
    )
    other = [line for line, shown in zip(copy, original, strict=True) if line != shown]
    assert [line.partition("#")[0].strip() for line in other] == [
        'name = "mine"',
        f'description = "Copy of {name}, changed"',
    ]
    owner = text_files()[file.kind].owner
    value: Any = read_text(owner, file.text, name)
    assert read_text(owner, to_toml(value), "written") == value
    code, out, _ = infoset(noun, "check", "mine.toml")
    ok, *facts = out.splitlines()
    assert (code, ok) == (0, f"ok  mine  {fingerprint(value)}")
    expected = FACTS if noun == "scenarios" else []
    if name in ("dart-2022", "deep-impact-2005", "haiv-2013"):
        expected = [*FACTS[:-1], CAMERA_FACT, FACTS[-1]]
    if noun == "scenarios" and value.sun is not None:
        expected = [*expected[:-1], f"{expected[-1]}, without gravity"]
    assert [fact.partition(":")[0] for fact in facts] == expected
    found = json.loads(infoset(noun, "check", "mine.toml", "--json")[1])
    assert (found["name"], found.get("kind", SCENARIO)) == ("mine", file.kind)
    assert infoset(noun, "check", name, "--quiet") == (0, "", "")


def test_check_prints_the_schedule_that_will_happen(infoset: Command) -> None:
    """864000 km at 10.3 km/s are 83883.495 s: 5592 steps of 15.000625 s."""
    _, out, _ = infoset("scenarios", "check", "deep-impact-2005")
    assert out.splitlines()[1:5] == [
        "flight: 23.3 h in 5592 steps of 15.00063 s (asked: 15 s)",
        "images: 480, from 7200.3 s to 15.00063 s before the nominal arrival; "
        "431 before the last decision of an impulse",
        "possible impulses: 3, from 5400.225 s to 750.0313 s before the nominal arrival",
        "true arrival: from -8.926 s to +8.927 s after the nominal arrival; the last impulse is "
        "741.1053 s to 758.9581 s before it",
    ]
    found = json.loads(infoset("scenarios", "check", "deep-impact-2005", "--json")[1])
    schedule = found["schedule"]
    assert schedule["asked_step_s"] == 15.0
    assert schedule["step_s"] == pytest.approx(864e6 / 10.3e3 / 5592)
    assert schedule["images"]["number"] == 480
    assert schedule["impulses"]["number"] == 3
    assert schedule["impulses"]["last_s"] == pytest.approx(50 * 864e6 / 10.3e3 / 5592)
    # The starts of [dispersion]: 863950 to 864050 km, 10.2995 to 10.3005 km/s.
    nominal_s = 864e6 / 10.3e3
    assert schedule["true_arrivals_s"] == pytest.approx(
        [863950e3 / 10300.5 - nominal_s, 864050e3 / 10299.5 - nominal_s]
    )
    assert schedule["differences"] == []
    assert set(found["possible_miss"]) == {"images_m", "images_and_speeds_m"}


def test_check_prints_the_centre_of_brightness(infoset: Command) -> None:
    """0.389 of 75 m; the residual is 75 m (0.389 (0.3 + 0.06 * 1.3) + 0.85 * 1.3 * 0.3 sin 60)."""
    settings = ("camera.phase_angle_deg=60", "camera.sun_angle_deg=90", "camera.brightness=mean")
    options = [option for setting in settings for option in ("--set", setting)]
    lines = infoset("scenarios", "check", "dart-2022", *options)[1].splitlines()
    residual = (
        "residual of a correction: 32.6 m (8.8 m by the radius, 2.3 m by the brightness, 22 m by "
        "the shape) if the radius is known to 30 % and the axis ratio is at least 0.7; "
        "centroid_error_m is 10 m"
    )
    assert [line for line in lines if line.startswith(("centre", "residual"))] == [
        "centre of brightness: 29.2 m from the centre (y 0 m, z 29.2 m); the set subtracts "
        "it and allows for centroid_error_m, 10 m",
        residual,
    ]
    uncorrected = [*options, "--set", "camera.phase_correction=false", "--json"]
    found = json.loads(infoset("scenarios", "check", "dart-2022", *uncorrected)[1])
    lines = infoset("scenarios", "check", "dart-2022", *uncorrected[:-1])[1].splitlines()
    (line,) = [line for line in lines if line.startswith("centre of brightness")]
    assert line.endswith("the set does not subtract it and allows for y 10 m, z 39.2 m")
    brightness = found["centre_of_brightness"]
    assert brightness["phase_correction"] is False
    assert brightness["offset_m"] == pytest.approx([0.0, 0.389064 * 75.0], abs=1e-4)
    assert brightness["residual_m"] == pytest.approx(32.6, abs=0.05)


def test_check_lists_few_of_many_differences(infoset: Command) -> None:
    settings = (
        "thruster.last_impulse_s=120",
        "thruster.impulse_period_s=64",
        "thruster.first_impulse_s=440",
    )
    options = [option for setting in settings for option in ("--set", setting)]
    _, out, _ = infoset("scenarios", "check", "dart-2022", *options)
    (line,) = [line for line in out.splitlines() if line.startswith("thruster.impulse_period_s")]
    assert line == (
        "thruster.impulse_period_s: 180 s instead of 184 s; 250 s instead of 248 s; 310 s instead "
        "of 312 s, and 1 more (nearest possible times)"
    )
    assert "possible impulses: 6, from 440 s to 120 s before the nominal arrival" in out


def test_check_says_how_wrong_impulses_would_be_in_place_of_burns(infoset: Command) -> None:
    """1.7 m/s take 85 s, and 2 % more: 0.5 * 85 s * 1.7 m/s is 72.25 m. 180 s before the arrival
    the error of an image is 5e-6 * 11.5 km/s * 180 s + 5 m = 15.35 m.
    """
    settings = (
        *("step_s=90", "camera.period_s=90"),
        *("thruster.max_impulse_m_s=1.7", "thruster.thrust_N=10", "thruster.mass_kg=500"),
    )
    options = [option for setting in settings for option in ("--set", setting)]
    _, out, _ = infoset("scenarios", "check", "haiv-2013", *options)
    (line,) = [line for line in out.splitlines() if line.startswith("burns: ")]
    assert line == (
        "burns: up to 86.7 s; as impulses they would be wrong by up to 72.25 m, 470.7 % of the "
        "error of an image at the last one (below 2 %, thrust_N and mass_kg may be left out)"
    )


def test_check_prints_the_latest_last_impulse_of_burns(infoset: Command) -> None:
    """The object arrives up to 5 s early (82750 km at 11.501 km/s), and a burn takes 86.7 s: of the
    steps 90 s and 180 s before the arrival only the second one is early enough; with burns of
    83 s the first one is.
    """
    assert pytest.approx(-4.97, abs=0.01) == 82750.0 / 11.501 - 7200.0
    settings = ("step_s=90", "camera.period_s=90", "thruster.thrust_N=10", "thruster.mass_kg=500")
    options = [option for setting in settings for option in ("--set", setting)]
    found = []
    for max_impulse_m_s in (1.7, 1.6):
        size = ("--set", f"thruster.max_impulse_m_s={max_impulse_m_s}")
        _, out, _ = infoset("scenarios", "check", "haiv-2013", *options, *size)
        found += [line for line in out.splitlines() if line.startswith("latest possible last_imp")]
    long, short = found
    assert long == (
        "latest possible last_impulse_s: 180 s; a later burn of the maximum impulse might not end "
        "before the earliest possible arrival"
    )
    assert short.startswith("latest possible last_impulse_s: 90 s")

    _, out, _ = infoset("scenarios", "check", "haiv-2013", *options, *size, "--json")
    assert json.loads(out)["schedule"]["latest_last_impulse_s"] == pytest.approx(90.0)
    _, out, _ = infoset("scenarios", "check", "haiv-2013", "--json")
    assert json.loads(out)["schedule"]["latest_last_impulse_s"] is None


TOO_FAR = (
    "flight: the nominal arrival is more than 100000 steps of 10 s away, so the schedule is not "
    "printed; check nominal_range_m, or write a longer step_s"
)


def _line_of_the_flight(out: str) -> str:
    """Return the only line after the first one."""
    _, line = out.splitlines()
    return line


def test_check_of_a_nominal_arrival_that_is_far_too_late(infoset: Command) -> None:
    setting = "nominal_range_m=1e50"
    code, out, err = infoset("scenarios", "check", "dart-2022", "--set", setting)
    assert code == 0
    assert _line_of_the_flight(out) == TOO_FAR
    assert "nominal_range_m is 1e+50 m, far outside" in err
    found = json.loads(infoset("scenarios", "check", "dart-2022", "--set", setting, "--json")[1])
    assert found["schedule"] is found["possible_miss"] is None


def test_check_says_that_the_nominal_arrival_is_too_far_for_a_schedule(infoset: Command) -> None:
    """1e10 m at 6.1 km/s are 160 000 steps, and less than ten times the greatest possible range."""
    settings = ("uncertainty.x_m=[2e9,2.1e9]", "dispersion.x_m=[2e9,2.1e9]", "nominal_range_m=1e10")
    options = [text for setting in settings for text in ("--set", setting)]
    code, out, err = infoset("scenarios", "check", "dart-2022", *options)
    assert (code, err) == (0, "")
    assert _line_of_the_flight(out) == TOO_FAR


@pytest.mark.parametrize(
    ("noun", "name", "setting", "wrong"),
    [
        ("scenarios", "dart-2022", "thruster.last_impulse_s=900", "thruster.last_impuls_s=900"),
        ("problems", "service-2", "target.2.time_min=45", "target.2.tim_min=45"),
    ],
)
def test_check_takes_settings(
    noun: str, name: str, setting: str, wrong: str, infoset: Command
) -> None:
    plain, changed = (
        json.loads(infoset(noun, "check", name, *more, "--json")[1])
        for more in ([], ["--set", setting])
    )
    hashes = [found.get("scenario_hash") or found["problem_hash"] for found in (plain, changed)]
    assert hashes[0] != hashes[1]
    assert "has no key" in infoset.refused(noun, "check", name, "--set", wrong)


@pytest.mark.parametrize("noun", MINE)
def test_file_is_replaced_only_with_overwrite(noun: str, infoset: Command) -> None:
    file = Path("mine.toml")
    file.write_text("precious")
    assert "--overwrite" in infoset.refused(noun, "new", file)
    assert file.read_text() == "precious"
    assert infoset(noun, "new", file, "--overwrite")[0] == 0
    assert len(file.read_text()) > 500


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "scenarios show asteroid-1996",
            'scenario: there is no "asteroid-1996"; did you mean asteroid-1997',
        ),
        (
            "problems new mine.toml --like pareto-2009",
            'there is no "pareto-2009"; did you mean pareto-2008?',
        ),
        (
            "problems check asteroid-1997",
            "asteroid-1997: this is a scenario; use infoset engage asteroid-1997",
        ),
        ("scenarios new file/mine.toml", "File exists"),
        ("scenarios check binary", "is not text in UTF-8"),
        ("problems check empty", "kind: must be one of pareto-encounter, multipoint"),
        ("problems check odd", "kind: must be one of"),
        ("problems check broken", "is not valid TOML"),
        ("replay empty", "empty: is not a readable record"),
    ],
)
def test_wrong_file_or_option_is_refused_with_one_message(
    line: str, message: str, infoset: Command
) -> None:
    contents = {
        "file": b"",
        "empty": b"",
        "binary": b"\x93NUMPY\xff\x00",
        "odd": b"kind = [1]",
        "broken": b"kind = ",
    }
    for name, content in contents.items():
        Path(name).write_bytes(content)
    arguments = [f"./{word}" if word in contents else word for word in line.split()]
    assert message in infoset.refused(*arguments)


def test_file_beyond_the_size_limit_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "x.toml"
    file.write_bytes(b"x" * 10)
    assert read_input(file, 10) == b"x" * 10
    with pytest.raises(InputError, match="has more than 9 bytes"):
        read_input(file, 9)
