"""The command `infoset`."""

from __future__ import annotations

import errno
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version as installed_version
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from experiments.campaigns.command import Campaign, Report, Sweep
from experiments.common.command import command
from experiments.common.errors import INTERRUPTED, InputError, on_a_screen
from experiments.files_command import problems, scenarios
from experiments.interception.command import Adversary, Bound, Compare, Engage, Experiment, Replay
from experiments.multipoint.command import Multipoint
from experiments.observer.command import Observe
from experiments.pareto.command import Pareto
from experiments.pursuit.command import Pursuit, PursuitMap
from experiments.reachability.command import Reach
from experiments.reproduce import Reproduce

INPUT_ERROR = 2
_UsageError: Any = typer.BadParameter.__base__
"""Base of Typer's errors about options and arguments; Typer does not export it."""

TOOLS = "Tools"
COMMANDS: Mapping[str, Sequence[tuple[type, str, str]]] = {
    "Interception": [
        (Experiment, "interception.runs.experiment", "experiment asteroid-1997 --runs 50 --out results"),
        (Engage, "interception.runs.engage", "engage asteroid-1997-single --noise both --out figures"),
        (Compare, "interception.runs.compare", "compare --strategies patient,symmetric-miss --out results"),
        (Bound, "interception.runs.bound", "bound asteroid-1997 --strategies patient --out results"),
        (
            Adversary,
            "interception.runs.adversary",
            "adversary --strategy symmetric-miss --budget 2000 --record worst.npz",
        ),
        (Replay, "interception.runs.replay", "replay flight-random.npz flight-game.npz --html flights.html"),
    ],
    "Campaigns of interceptions": [
        (Campaign, "campaigns.run_campaign", "campaign --noise mixed --runs 100000 --out runs"),
        (
            Sweep,
            "campaigns.run_sweep",
            "sweep --set body.radius_m=80 --vary angle_sensor.scale=1:8:8,thruster.max_impulse_m_s=2.5:20:8 "
            "--runs 100 --until decided --out sensors",
        ),
        (Report, "campaigns.run_report", "report runs --out figures"),
    ],
    "Rendezvous": [
        (Pursuit, "pursuit.run", "pursuit geo-pursuit --certify --feedback coast --out results"),
        (
            PursuitMap,
            "pursuit.map",
            "pursuit-map geo-pursuit --x phase_deg=-60:60:61 --y thrust_ratio=0:0.9:19 --out map",
        ),
        (Reach, "reachability.run", "reach rendezvous-2021 --select energy,vertices --replan --out reach"),
        (Pareto, "pareto.run", "pareto pareto-2008 --prefer x_m=0,z_m=50 --out figures"),
        (Multipoint, "multipoint.run", "multipoint service-3 --order best --times best --out figures"),
    ],
    "Set-membership estimation": [(Observe, "observer.run", "observe vehicle --smooth --out results")],
    TOOLS: [(Reproduce, "reproduced_numbers", "reproduce --paper pareto --json numbers.json")],
}
"""By panel of the help: options, module of the run in `experiments`, and example, whose first word is the name."""


class _Root(TyperGroup):
    """Reports an error as one message without a traceback."""

    def make_context(self, info_name: str | None, args: list[str], *rest: Any, **options: Any) -> Any:
        is_bare = not args  # the error is then the help
        try:
            return super().make_context(info_name, args, *rest, **options)
        except _UsageError as error:
            if is_bare:
                raise
            raise _ended(_usage_message(error), INPUT_ERROR) from None
        except KeyboardInterrupt:
            raise _ended("interrupted", INTERRUPTED) from None

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except InputError as error:
            raise _ended(f"error: {error}", INPUT_ERROR) from None
        except _UsageError as error:
            raise _ended(_usage_message(error), INPUT_ERROR) from None
        except MemoryError as error:
            raise _ended(_out_of_memory(error), INPUT_ERROR) from None
        except OSError as error:
            if error.errno == errno.EPIPE:  # the reader of a pipe has closed it: no error
                raise
            where = f"{error.filename}: " if error.filename is not None else ""
            reason = error.strerror or error
            raise _ended(f"error: {where}{reason}; check the disk and its permissions", INPUT_ERROR) from None
        except KeyboardInterrupt as interrupt:
            raise _ended("interrupted" + "".join(map(str, interrupt.args)), INTERRUPTED) from None


app = typer.Typer(
    name="infoset",
    cls=_Root,
    epilog="Example: infoset experiment --runs 50 --out results",
    no_args_is_help=True,
    rich_markup_mode=None,  # plain help: the text has 45 of 80 columns, in a table of Rich 20
    pretty_exceptions_enable=False,
)
for panel, rows in COMMANDS.items():
    for options, run, example in rows:
        register = app.command(example.split()[0], rich_help_panel=panel, epilog=f"Example: infoset {example}")
        register(command(options, f"experiments.{run}"))
app.add_typer(scenarios, rich_help_panel=TOOLS)
app.add_typer(problems, rich_help_panel=TOOLS)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"infoset {installed_version('infoset')}")
        raise typer.Exit


@app.callback()
def infoset(
    version: Annotated[
        bool,
        typer.Option("--version", metavar="", callback=_show_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    """Simulate interceptions guided by information sets, and solve rendezvous and pursuit problems.

    An information set contains all states that are consistent with the measurements, the impulses and the model.
    """


@cache
def commands() -> Any:
    """Return the commands as Click runs them; cached because building them takes 0.05 s."""
    return typer.main.get_command(app)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command `infoset`, and exit with its code; None takes the arguments from the process.

    It always raises `SystemExit`: 0 done, 1 a published number disagrees, 2 wrong input, 130 interrupted.
    """
    try:
        commands()(args=None if arguments is None else list(arguments), prog_name="infoset")
    except MemoryError as error:
        typer.echo(_out_of_memory(error), err=True)
        sys.exit(INPUT_ERROR)


def _out_of_memory(error: MemoryError) -> str:
    reason = f" ({error})" if error.args else ""
    return f"error: Not enough memory{reason}. Free some memory and run it again."


def _usage_message(error: Any) -> str:
    """Return the message of an error about options and arguments, in one line and with the command that has help."""
    message = " ".join(error.format_message().split()).rstrip(".")
    command = error.ctx.command_path if error.ctx else "infoset COMMAND"
    return f"error: {message[:1].lower()}{message[1:]}{'' if message.endswith('?') else ';'} see {command} --help"


def _ended(message: str, code: int) -> typer.Exit:
    typer.echo(on_a_screen(message), err=True)
    return typer.Exit(code)
