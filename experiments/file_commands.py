"""The commands `infoset scenarios` and `infoset problems`.

They list, show, copy and check files. The limits of the numbers of their options are chosen.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from infoset.experiments.common.built_in_files import (
    PROBLEMS,
    SCENARIO,
    BuiltIn,
    built_in,
    built_in_files,
)
from infoset.experiments.common.options import AsJson, Overwrite, Quiet, Settings, command_of

BuiltInName = Annotated[str, typer.Argument(metavar="NAME", help="A built-in name.")]
FileName = Annotated[str, typer.Argument(metavar="FILE", help="A file, or a built-in name.")]
Like = Annotated[str, typer.Option("--like", metavar="NAME", help="The built-in file to copy.")]
LikeScenario = Annotated[
    str,
    typer.Option(
        "--like",
        metavar="NAME",
        help="The scenario whose sensors, engine and settings the new one takes.",
    ),
]
Sigmas = Annotated[
    float,
    typer.Option(
        "--sigma",
        min=0.1,
        max=10.0,
        help="Number of standard deviations to which uncertainty and dispersion extend.",
    ),
]
MagnitudeText = Annotated[
    str | None,
    typer.Option(
        "--magnitude",
        metavar="H=MAG,limit=MAG,phase=DEG",
        help=(
            "Print the first image in which the body is bright enough: from its absolute magnitude "
            "H, the limiting magnitude of the camera and the phase angle, deg (default: "
            "camera.phase_angle_deg)."
        ),
    ),
]
BodyRadius = Annotated[
    float | None,
    typer.Option(
        "--body-radius-m",
        metavar="M",
        min=1e-3,
        max=1e9,
        help="Radius of the target, m; without it hits are not counted.",
    ),
]
Disturbance = Annotated[
    float | None,
    typer.Option(
        "--disturbance",
        metavar="M_S2",
        min=0.0,
        max=1e3,
        help="Bound of the target's acceleration beside gravity, m/s^2; without it: 0.",
    ),
]
FilesIn = Annotated[
    list[Path] | None,
    typer.Option(
        "--files-in",
        metavar="FOLDER",
        help="A folder whose OEM files and kernels the file may name too; repeat it for several.",
    ),
]
Out = Annotated[
    Path, typer.Option("--out", metavar="FILE", help="The scenario file to write; - is stdout.")
]
ActiveCraft = Annotated[
    Path, typer.Argument(metavar="CHASER", help="OEM file of the active craft.")
]
PassiveCraft = Annotated[
    Path, typer.Argument(metavar="TARGET", help="OEM file of the passive craft.")
]
EpochText = Annotated[
    str,
    typer.Option(
        "--epoch",
        metavar="EPOCH",
        help="Epoch of t = 0, for example 2026-03-01T12:00:00; a time scale (UTC, TAI, TT, TDB, "
        "GPS) may follow, default: that of the files.",
    ),
]
LikeProblem = Annotated[
    str,
    typer.Option(
        "--like",
        metavar="NAME",
        help="Problem of infoset reach, built in or a file, that supplies all other values.",
    ),
]
CentralParameter = Annotated[
    float | None,
    typer.Option(
        "--gravitational-parameter",
        metavar="M3_S2",
        min=1e-6,
        max=1e21,
        help="Gravitational parameter of the centre, m^3/s^2. Default: that of the Earth, the "
        "Moon, Mars or the Sun.",
    ),
]
ProblemOut = Annotated[
    Path, typer.Option("--out", metavar="FILE", help="The problem file to write; - is stdout.")
]
_NAME = r"\w[\w .-]{0,99}"
"""Stems of files that can be the `name` in the file; "-", which is stdout, cannot."""
NewFile = Annotated[Path, typer.Argument(metavar="FILE", help="The file to write; - is stdout.")]


def _commands(noun: str, of_what: str, example: str) -> typer.Typer:
    """Return the commands for the files of a noun, scenario or problem.

    `example` is a built-in name.
    """
    name = f"infoset {noun}s"
    kinds = [SCENARIO] if noun == SCENARIO else [*PROBLEMS]
    app = typer.Typer(
        name=f"{noun}s",
        help=(
            f"List, show, check and create {noun} files.\n"
            "\n"
            f"{of_what} Without a command, list the built-in {noun}s."
        ),
        epilog=f"Example: {name} new mine.toml --like {example}",
    )

    @app.callback(invoke_without_command=True)
    def default(context: typer.Context) -> None:
        if context.invoked_subcommand is None:
            list_files()

    @app.command("list", help=f"List the built-in {noun}s.", epilog=f"Example: {name} list")
    def list_files() -> None:
        _print_list([file for file in built_in_files().values() if file.kind in kinds])

    @app.command(
        help=f"Print a built-in {noun} file.", epilog=f"Example: {name} show {example} > mine.toml"
    )
    def show(name: BuiltInName) -> None:
        typer.echo(built_in(name, kinds).text, nl=False)

    @app.command(
        help=f"Copy a built-in {noun} file, to be changed.",
        epilog=f"Example: {name} new mine.toml --like {example}",
    )
    def new(
        file: NewFile, like: Like = example, overwrite: Overwrite = False, quiet: Quiet = False
    ) -> None:
        _write(
            file,
            _named(built_in(like, kinds).text, file.stem, like),
            f"a copy of {like}; change it, then: {name} check {file}",
            overwrite,
            quiet,
        )

    command = app.command(
        "check",
        help=f"Check a {noun} file. If it has errors, they are listed, and the exit code is 2.",
        epilog=f"Example: {name} check mine.toml",
    )
    command(_check_scenario if noun == SCENARIO else _check_problem)
    return app


def _check_scenario(
    file: FileName,
    settings: Settings = None,
    magnitude: MagnitudeText = None,
    json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    _print_check(_checked_scenario(file, settings, magnitude), json, quiet)


def _check_problem(
    file: FileName, settings: Settings = None, json: AsJson = False, quiet: Quiet = False
) -> None:
    _print_check(_checked_problem(file, settings), json, quiet)


def _named(text: str, name: str, like: str) -> str:
    """Return the text of a copy with another name and description, which its results have.

    The text is unchanged if the name is not one that a file can have (`_NAME`).
    """
    if not re.fullmatch(_NAME, name):
        return text
    description = f'description = "Copy of {like}, changed"'
    text = re.sub(r'(?m)^name = ".*"', f'name = "{name}"', text, count=1)
    return re.sub(r'(?m)^description = ".*"', description, text, count=1)


def _write(file: Path, text: str, note: str, overwrite: bool, quiet: bool) -> None:
    """Write a new file, and print a note about it on stderr; - is stdout."""
    from infoset.experiments.common.output import STDOUT, write_file

    if str(file) == STDOUT:
        typer.echo(text, nl=False)
        return
    write_file(file, text, overwrite=overwrite)
    if not quiet:
        typer.echo(f"wrote {file}, {note}", err=True)


def _print_list(files: Sequence[BuiltIn]) -> None:
    from infoset.experiments.common.screen import number_table, show

    names = ("name", "kind", "description")
    table = number_table(*names, left=len(names))
    for file in files:
        table.add_row(file.name, file.kind, file.description)
    show([table], quiet=False)


class _Checked(NamedTuple):
    """A file without errors: its fingerprint, its keys in JSON, and lines for the screen."""

    name: str
    fingerprint: str
    keys: Mapping[str, object]
    facts: Sequence[str] = ()
    warnings: Sequence[str] = ()


def _checked_scenario(file: str, settings: Sequence[str] | None, magnitude: str | None) -> _Checked:
    from infoset.experiments.interception.first_image import first_image
    from infoset.experiments.interception.scenario_file import (
        all_warnings,
        brightness_json,
        flight_facts,
        load_scenario,
        possible_miss_json,
        schedule_json,
    )
    from infoset.sim.storage.codec import fingerprint

    scenario = load_scenario(file, settings)
    keys: dict[str, object] = {
        "scenario_hash": fingerprint(scenario),
        "schedule": schedule_json(scenario),
        "possible_miss": possible_miss_json(scenario),
        "centre_of_brightness": brightness_json(scenario),
    }
    facts = flight_facts(scenario)
    if magnitude is not None:
        first = first_image(scenario, magnitude)
        keys["first_image"] = first
        facts = [*facts, str(first)]
    return _Checked(
        scenario.name,
        fingerprint(scenario),
        keys,
        facts,
        all_warnings(scenario),
    )


def _checked_problem(file: str, settings: Sequence[str] | None) -> _Checked:
    from infoset.experiments.common.input_file import load_problem
    from infoset.sim.storage.codec import fingerprint

    problem = load_problem(file, settings)
    keys = {"kind": problem.kind, "problem_hash": fingerprint(problem)}
    return _Checked(problem.name, fingerprint(problem), keys)


def _print_check(checked: _Checked, json: bool, quiet: bool) -> None:
    """Print the name, fingerprint, facts and warnings of a file without errors.

    With `json` the keys are printed even if `quiet`, and the warnings are among them.
    """
    from infoset.experiments.common.output import to_json
    from infoset.experiments.common.screen import say_warnings
    from infoset.sim.versions import versions

    if json:
        keys = {"versions": versions(), "name": checked.name, **checked.keys}
        typer.echo(to_json({**keys, "warnings": checked.warnings}), nl=False)
    elif not quiet:
        typer.echo("\n".join([f"ok  {checked.name}  {checked.fingerprint}", *checked.facts]))
    say_warnings(checked.warnings, quiet or json)


scenarios = _commands(SCENARIO, "A scenario is an interception.", "own-scenario")


@dataclass(frozen=True)
class FromStates:
    """Make a scenario from the states of a spacecraft and an object, and their covariance."""

    file: FileName
    out: Out
    like: LikeScenario = "dart-2022"
    sigma: Sigmas = 3.0
    body_radius_m: BodyRadius = None
    disturbance: Disturbance = None
    files_in: FilesIn = None
    overwrite: Overwrite = False
    quiet: Quiet = False


def _from_states(options: FromStates) -> None:
    from infoset.experiments.common.screen import say_warnings
    from infoset.experiments.interception.scenario_file import all_warnings, load_scenario
    from infoset.experiments.interception.trajectory_file import KnownTarget, scenario_of

    model = load_scenario(options.like)
    target = KnownTarget(options.body_radius_m, options.disturbance)
    found = scenario_of(options.file, model, options.sigma, target, options.files_in or ())
    note = (
        f"with the sensors and the engine of {model.name}; change them, then: infoset scenarios "
        f"check {options.out}"
    )
    _write(options.out, found.text, note, options.overwrite, options.quiet)
    say_warnings([*found.warnings, *all_warnings(found.scenario)], options.quiet, found.notes)


scenarios.command(
    "from-states",
    help=FromStates.__doc__,
    epilog="Example: infoset scenarios from-states two-states --sigma 3 --out mine.toml",
)(command_of(FromStates, _from_states))


@dataclass(frozen=True)
class FromOrbits:
    """Make a rendezvous from two OEM files: its start, the orbit of the passive craft, and the
    motion about it.
    """

    chaser: ActiveCraft
    target: PassiveCraft
    epoch: EpochText
    out: ProblemOut
    like: LikeProblem = "elliptic-guaranteed"
    settings: Settings = None
    gravitational_parameter: CentralParameter = None
    overwrite: Overwrite = False
    quiet: Quiet = False


def _from_orbits(options: FromOrbits) -> None:
    from infoset.experiments.common.screen import say_warnings
    from infoset.experiments.reachability.from_states import problem_of

    found = problem_of(
        options.chaser,
        options.target,
        options.epoch,
        options.like,
        options.settings,
        options.gravitational_parameter,
        name=options.out.stem if re.fullmatch(_NAME, options.out.stem) else None,
    )
    note = f"with the values of {options.like}; change them, then: infoset reach {options.out}"
    _write(options.out, found.text, note, options.overwrite, options.quiet)
    say_warnings(found.warnings, options.quiet, found.notes)


problems = _commands(
    "problem",
    "A problem is one of rendezvous, pursuit or estimation, or a trajectory.",
    "service-2",
)
problems.command(
    "from-states",
    help=FromOrbits.__doc__,
    epilog=(
        "Example: infoset problems from-states chaser.oem station.oem --epoch 2026-03-01T12:00:00 "
        "--out mine.toml"
    ),
)(command_of(FromOrbits, _from_orbits))
