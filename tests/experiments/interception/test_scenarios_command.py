from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from experiments.common.errors import InputError
from experiments.files_command import scenarios
from experiments.interception.scenario_file import load_scenario
from sim.storage.codec import fingerprint
from tests.built_in import scenario_names, scenario_text

NAMES = list(scenario_names())


def root() -> typer.Typer:
    """The command as `infoset` mounts it."""
    outer = typer.Typer()
    outer.add_typer(scenarios, name="scenarios")

    @outer.callback()
    def infoset() -> None:
        pass

    return outer


def invoke(*arguments: str) -> tuple[int, str, str]:
    """Exit code, stdout and stderr, with an InputError turned into exit code 2 as the command line does."""
    result = CliRunner().invoke(root(), ["scenarios", *arguments], env={"COLUMNS": "150", "NO_COLOR": "1"})
    if isinstance(result.exception, InputError):
        return 2, result.stdout, f"error: {result.exception}\n"
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    return result.exit_code, result.stdout, result.stderr


@pytest.mark.parametrize("arguments", [[], ["list"]])
def test_list_names_and_describes_every_scenario(arguments: list[str]) -> None:
    code, out, err = invoke(*arguments)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert [name for name in NAMES if any(line.startswith(f"{name} ") for line in lines)] == NAMES
    assert "head-on interception" in out


@pytest.mark.parametrize("arguments", [["--json"], ["list", "--json"], ["list", "--json", "--quiet"]])
def test_list_as_json(arguments: list[str]) -> None:
    code, out, _ = invoke(*arguments)
    assert code == 0
    assert json.loads(out) == [{"name": name, "description": load_scenario(name).description} for name in NAMES]


@pytest.mark.parametrize("arguments", [["--quiet"], ["list", "-q"]])
def test_quiet_list_is_names_alone(arguments: list[str]) -> None:
    assert invoke(*arguments) == (0, "\n".join(NAMES) + "\n", "")


def test_options_before_the_subcommand_are_not_swallowed() -> None:
    code, _, err = invoke("--json", "check", "asteroid-1997")
    assert code == 2
    assert "after" in err


@pytest.mark.parametrize("name", NAMES)
def test_show_prints_the_file_as_it_is(name: str) -> None:
    assert invoke("show", name) == (0, scenario_text(name), "")


def test_show_of_an_unknown_name() -> None:
    code, out, err = invoke("show", "asteroid-1996")
    assert (code, out) == (2, "")
    assert err.startswith('error: no built-in scenario is called "asteroid-1996"; did you mean "asteroid-1997')


@pytest.mark.parametrize("name", NAMES)
def test_check_says_ok_with_name_and_hash(name: str) -> None:
    code, out, err = invoke("check", name)
    assert (code, err) == (0, "")
    assert out.split() == ["ok", name, fingerprint(load_scenario(name))]


def wide(tmp_path: Path) -> Path:
    file = tmp_path / "wide.toml"
    file.write_text(scenario_text("asteroid-1997").replace("z_km = [-1.0, 1.0]", "z_km = [-12.0, 1.0]"))
    return file


def test_check_prints_warnings_and_still_succeeds(tmp_path: Path) -> None:
    code, out, _ = invoke("check", str(wide(tmp_path)))
    assert code == 0
    assert out.splitlines()[0].startswith("ok")
    assert out.splitlines()[1].startswith("warning: dispersion.z_m reaches 2000 m below uncertainty.z_m")


def test_check_as_json(tmp_path: Path) -> None:
    file = wide(tmp_path)
    code, out, _ = invoke("check", str(file), "--json")
    found = json.loads(out)
    assert code == 0
    assert found.pop("warnings")[0].startswith("dispersion.z_m")
    assert found == {
        "version": version("infoset"),
        "name": "asteroid-1997",
        "scenario_hash": fingerprint(load_scenario(file)),
    }


def test_quiet_check_prints_nothing() -> None:
    assert invoke("check", "comet-fast", "--quiet") == (0, "", "")


@pytest.mark.parametrize(
    ("old", "new", "parts"),
    [
        ("step_s = 0.5", "step_s = -0.5", ["step_s", "greater than 0"]),
        ("step_s = 0.5", "stp_s = 0.5", ["stp_s: is not a known key; did you mean step_s?"]),
        ("distance_km = 150.0e6", "distance_km = ", ["is not valid TOML", "line 14"]),
        ("x_km = [5301.3", "x_km = [inf", ["uncertainty.x_km", "finite"]),
        ('"symmetric-miss"', '"[red]odd[/red]"', ["strategy", '"[red]odd[/red]"']),
    ],
)
def test_check_of_a_bad_file(old: str, new: str, parts: list[str], tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(scenario_text("asteroid-1997").replace(old, new))
    code, out, err = invoke("check", str(file))
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert str(file) in err
    assert "Traceback" not in err
    for part in parts:
        assert part in err


@pytest.mark.parametrize("kind", ["missing", "folder", "binary"])
def test_check_of_what_is_no_file_of_text(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "x.toml"
    if kind == "folder":
        path.mkdir()
    elif kind == "binary":
        path.write_bytes(b"\x93NUMPY\xff\x00")
    code, out, err = invoke("check", str(path))
    assert (code, out) == (2, "")
    assert str(path) in err


def test_new_writes_the_template_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    code, out, _ = invoke("new", str(file))
    assert code == 0
    assert f"infoset scenarios check {file}" in out
    assert file.read_text() == scenario_text("own-scenario")
    assert list(tmp_path.iterdir()) == [file]
    assert invoke("check", str(file))[0] == 0


def test_quiet_new_prints_nothing(tmp_path: Path) -> None:
    assert invoke("new", str(tmp_path / "mine.toml"), "--quiet") == (0, "", "")


def test_new_never_replaces_unless_told(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("precious")
    code, _, err = invoke("new", str(file))
    assert code == 2
    assert "exists already" in err
    assert "--overwrite" in err
    assert file.read_text() == "precious"
    assert invoke("new", str(file), "--overwrite")[0] == 0
    assert file.read_text() == scenario_text("own-scenario")
    assert list(tmp_path.iterdir()) == [file]


def test_new_does_not_replace_a_dangling_link(tmp_path: Path) -> None:
    link = tmp_path / "mine.toml"
    link.symlink_to(tmp_path / "nowhere")
    assert invoke("new", str(link))[0] == 2
    assert link.is_symlink()


@pytest.mark.parametrize("path", [".", "missing/mine.toml", "file/mine.toml", "n" * 300])
def test_new_where_nothing_can_be_written(path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    code, out, err = invoke("new", path)
    assert (code, out) == (2, "")
    assert err.startswith("error: ")
    assert [each.name for each in tmp_path.iterdir()] == ["file"]


def test_new_in_a_folder_that_may_not_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:  # chmod does not stop root
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    code, _, err = invoke("new", str(tmp_path / "mine.toml"))
    assert code == 2
    assert "cannot be written: Permission denied; choose a folder in which you have write permission" in err


@pytest.mark.parametrize("command", [[], ["list"], ["show"], ["check"], ["new"]])
def test_help_has_an_example(command: list[str]) -> None:
    code, out, _ = invoke(*command, "--help")
    assert code == 0
    assert "Example: infoset scenarios" in out


def test_importing_the_command_imports_nothing_heavy() -> None:
    heavy = ["numpy", "pydantic", "rich", "numba", "matplotlib", "experiments.interception.scenario_file"]
    module = "experiments.files_command"
    code = f"import {module}, sys; print([each for each in {heavy} if each in sys.modules])"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
