"""The command `infoset`."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from importlib.metadata import version as installed_version
from typing import Annotated, Any

import typer

from infoset.experiments.campaigns.command import CampaignOptions, ReportOptions, Sweep
from infoset.experiments.common.errors import InputError, on_a_screen
from infoset.experiments.common.options import command_of
from infoset.experiments.file_commands import problems, scenarios
from infoset.experiments.interception.command import (
    Adversary,
    Bound,
    Compare,
    Engage,
    Experiment,
    Replay,
)
from infoset.experiments.multipoint.command import Multipoint
from infoset.experiments.observer.command import Observe
from infoset.experiments.pareto.command import Pareto
from infoset.experiments.pursuit.command import Pursuit, PursuitMap
from infoset.experiments.reachability.command import Reach
from infoset.experiments.reproduce import Reproduce

app = typer.Typer(
    name="infoset",
    epilog="Example: infoset experiment --runs 50 --out results",
    no_args_is_help=True,
    rich_markup_mode=None,  # plain help: its text has 45 of 80 columns, in a table of Rich 20
    pretty_exceptions_enable=False,
)
EXTRAS = {
    **dict.fromkeys(("pandas", "pyarrow"), "campaign"),
    "spiceypy": "trajectory",
    "distributed": "distributed",
}
"""The optional extra of each library that a command may lack."""
BACKEND = "MPLBACKEND"
"""Environment variable with the backend of Matplotlib."""
RUNS: dict[type, str] = {}
"""The module in `infoset.experiments` of each command, by the class of its options.

The function ``run`` of the module takes the options.
"""


def _add(name: str, options: type, run: str, *, example: str) -> None:
    """Add a command.

    The fields of the dataclass `options` are its options and arguments, see `command_of`, and its
    docstring is the help; the first sentence stands in the list of commands. The module `run` is
    imported when the command runs, so that ``--help`` does not wait for it.
    """
    RUNS[options] = f"infoset.experiments.{run}"

    def run_it(given: Any) -> None:
        from infoset.kernels import NOTICE  # loads Numba

        try:
            with NOTICE.of(f"infoset {name}"):
                import_module(RUNS[options]).run(given)
        except KeyboardInterrupt as interrupt:
            typer.echo("interrupted" + "".join(map(str, interrupt.args)), err=True)
            raise

    epilog = f"Example: infoset {name} {example}"
    app.command(name, help=options.__doc__, epilog=epilog)(command_of(options, run_it))


_add(
    "experiment",
    Experiment,
    "interception.runs.experiment",
    example="asteroid-1997 --runs 50 --out results",
)
_add(
    "engage",
    Engage,
    "interception.runs.engage",
    example="asteroid-1997-single --noise both --out figures",
)
_add(
    "compare",
    Compare,
    "interception.runs.compare",
    example="--strategies patient,symmetric-miss --out results",
)
_add(
    "bound",
    Bound,
    "interception.runs.bound",
    example="asteroid-1997 --strategies patient --out results",
)
_add(
    "adversary",
    Adversary,
    "interception.runs.adversary",
    example="--strategy symmetric-miss --budget 2000 --record worst.npz",
)
_add(
    "replay",
    Replay,
    "interception.runs.replay",
    example="flight-random.npz flight-game.npz --html flights.html",
)
_add(
    "campaign",
    CampaignOptions,
    "campaigns.run_campaign",
    example="--noise mixed --runs 100000 --out runs",
)
_add(
    "sweep",
    Sweep,
    "campaigns.run_sweep",
    example=(
        "--set body.radius_m=80 --vary angle_sensor.scale=1:8:8,thruster.max_impulse_m_s=2.5:20:8 "
        "--runs 100 --until decided --out sensors"
    ),
)
_add("report", ReportOptions, "campaigns.run_report", example="runs --out figures")
_add(
    "pursuit",
    Pursuit,
    "pursuit.run",
    example="geo-pursuit --certify --feedback coast --out results",
)
_add(
    "pursuit-map",
    PursuitMap,
    "pursuit.map",
    example="geo-pursuit --x phase_deg=-60:60:61 --y thrust_ratio=0:0.9:19 --out map",
)
_add(
    "reach",
    Reach,
    "reachability.run",
    example="rendezvous-2021 --select energy,vertices --replan --out reach",
)
_add("pareto", Pareto, "pareto.run", example="pareto-2008 --prefer x_m=0,z_m=50 --out figures")
_add(
    "multipoint",
    Multipoint,
    "multipoint.run",
    example="service-3 --order best --times best --out figures",
)
_add("observe", Observe, "observer.run", example="vehicle --smooth --out results")
_add("reproduce", Reproduce, "reproduced_numbers", example="--paper pareto --json numbers.json")
app.add_typer(scenarios)
app.add_typer(problems)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"infoset {installed_version('infoset')}")
        raise typer.Exit


@app.callback()
def infoset(
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_show_version, is_eager=True, help="Show the version and exit."
        ),
    ] = False,
) -> None:
    """Simulate interceptions guided by information sets, and solve rendezvous and pursuit problems.

    An information set contains all states that are consistent with the measurements, the impulses
    and the model.
    """


@cache
def commands() -> Any:
    """Return the commands as Typer runs them; cached because building them takes 0.05 s."""
    return typer.main.get_command(app)


@contextlib.contextmanager
def _agg_backend() -> Iterator[None]:
    """Let Matplotlib use Agg while a command runs; then restore the variable.

    A backend of the user's that is missing would stop the import of Matplotlib. A notebook, for
    example, sets its backend for all processes that it starts.
    """
    before = os.environ.get(BACKEND)
    os.environ[BACKEND] = "agg"
    try:
        yield
    finally:
        if before is None:
            del os.environ[BACKEND]
        else:
            os.environ[BACKEND] = before


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command `infoset`, and exit with its code; None takes the arguments from the process.

    It raises `SystemExit`: 0 done; 1 a published number disagrees, or stdout was closed early; 2
    wrong input, an error of files or memory, or a library of an extra is missing; 130 interrupted.
    Any other error is a mistake of the program, and is raised as it is.
    """
    try:
        with _agg_backend():
            commands()(args=arguments, prog_name="infoset")
    except (InputError, OSError, MemoryError, ModuleNotFoundError) as error:
        message = str(error) or "not enough memory"
        if isinstance(error, ModuleNotFoundError):
            library = str(error.name).partition(".")[0]
            if library not in EXTRAS:
                raise
            message = (
                f"{library} is not installed: install infoset with the extra [{EXTRAS[library]}]"
            )
        typer.echo(on_a_screen(f"error: {message}"), err=True)
        sys.exit(2)
