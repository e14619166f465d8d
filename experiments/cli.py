"""The command `infoset`."""

from __future__ import annotations

import errno
import os
import sys
import threading
import time
from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from experiments.campaigns.command import campaign, report, sweep
from experiments.common.compile_cache import keep_kernels_somewhere
from experiments.common.errors import INTERRUPTED, InputError, on_a_screen
from experiments.interception.commands.adversary import adversary
from experiments.interception.commands.bound import bound
from experiments.interception.commands.compare import compare
from experiments.interception.commands.engage import engage
from experiments.interception.commands.experiment import experiment
from experiments.interception.commands.replay import replay
from experiments.interception.commands.scenarios import app as scenarios
from experiments.multipoint.command import multipoint
from experiments.pareto.command import pareto
from experiments.problem_list import app as problems
from experiments.pursuit.command import pursuit, pursuit_map
from experiments.reachability.command import reach
from experiments.reproduce import reproduce

INPUT_ERROR = 2
PATIENCE_S = 5.0
"""How long threads may take to end after an error."""


class _Root(TyperGroup):
    """Says what went wrong in one message, without a traceback."""

    def make_context(self, *given: Any, **options: Any) -> Any:
        try:
            return super().make_context(*given, **options)
        except KeyboardInterrupt:
            _complain("interrupted")
            raise typer.Exit(INTERRUPTED) from None

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except InputError as error:
            _complain(f"error: {error}")
            raise typer.Exit(INPUT_ERROR) from None
        except MemoryError as error:
            _complain(f"error: there is not enough memory ({error}); ask for less at once, or give it more")
            raise typer.Exit(INPUT_ERROR) from None
        except OSError as error:
            if error.errno == errno.EPIPE:  # a reader that leaves is no error
                raise
            _complain(f"error: {_what_failed(error)}; check the disk and its permissions")
            raise typer.Exit(INPUT_ERROR) from None
        except KeyboardInterrupt as interrupt:
            _complain("interrupted" + "".join(map(str, interrupt.args)))
            raise typer.Exit(INTERRUPTED) from None


app = typer.Typer(
    name="infoset",
    cls=_Root,
    help="Fly interceptions guided by information sets: all states that agree with everything measured and done.",
    epilog="Example: infoset experiment --runs 50 --out results",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("experiment", epilog="Example: infoset experiment asteroid-1997 --runs 50 --out results")(experiment)
app.command("engage", epilog="Example: infoset engage asteroid-1997-single --noise both --out figures")(engage)
app.command("compare", epilog="Example: infoset compare --strategies patient,symmetric-miss --out results")(compare)
app.command("bound", epilog="Example: infoset bound asteroid-1997 --strategies patient --out results")(bound)
app.command(
    "adversary", epilog="Example: infoset adversary --strategy symmetric-miss --budget 2000 --record worst.npz"
)(adversary)
app.command("campaign", epilog="Example: infoset campaign --noise mixed --runs 100000 --out runs")(campaign)
app.command(
    "sweep",
    epilog="Example: infoset sweep --vary angle_sensor.error_at_nominal_range_rad=0.5e-4:5e-4:8,"
    "thruster.greatest_impulse_m_s=2:20:7 --runs 200 --out sensors",
)(sweep)
app.command("report", epilog="Example: infoset report runs --out figures")(report)
app.command("replay", epilog="Example: infoset replay flight-random.npz flight-game.npz --html flights.html")(replay)
app.command("pursuit", epilog="Example: infoset pursuit geo-pursuit --certify --feedback coast --out results")(pursuit)
app.command(
    "pursuit-map",
    epilog="Example: infoset pursuit-map geo-pursuit --x phase_deg=-60:60:61 --y thrust_ratio=0:0.9:19 --out map",
)(pursuit_map)
app.command("reach", epilog="Example: infoset reach rendezvous-2021 --select energy,vertices --replan --out reach")(
    reach
)
app.command("pareto", epilog="Example: infoset pareto pareto-2008 --prefer y_m=0,z_m=50 --out figures")(pareto)
app.command("multipoint", epilog="Example: infoset multipoint service-3 --order best --times best --out figures")(
    multipoint
)
app.command("reproduce", epilog="Example: infoset reproduce --paper pareto --json numbers.json")(reproduce)
app.add_typer(scenarios, name="scenarios")
app.add_typer(problems, name="problems")


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"infoset {version('infoset')}")
        raise typer.Exit


@app.callback()
def infoset(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    """Fly interceptions guided by information sets: all states that agree with everything measured and done."""


@cache
def commands() -> Any:
    """Return all commands as they are run; built once a process, which takes a twentieth of a second."""
    return typer.main.get_command(app)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command `infoset`, and leave with its exit code.

    Parameters
    ----------
    arguments : sequence of str or None
        What follows the name of the command; None takes them from the process.

    Raises
    ------
    SystemExit
        Always: 0 done, 2 something given is wrong, 130 interrupted.
    """
    try:
        keep_kernels_somewhere()
        commands()(args=None if arguments is None else list(arguments), prog_name="infoset")
    except MemoryError:
        _complain("error: there is not enough memory to begin with; give it more")
        sys.exit(INPUT_ERROR)
    except SystemExit as left:
        if left.code == INPUT_ERROR:
            _leave(INPUT_ERROR)
        raise


def _leave(code: int) -> NoReturn:
    """Leave, without threads that memory's end has left waiting for a lock which nobody holds any more."""
    flights = sys.modules.get("sim.flights")
    if flights is not None:
        threads = [each for each in threading.enumerate() if each.name.startswith(flights.THREADS)]
        last_s = time.monotonic() + PATIENCE_S
        for thread in threads:
            thread.join(max(0.0, last_s - time.monotonic()))
        if any(thread.is_alive() for thread in threads):
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    sys.exit(code)


def _complain(message: str) -> None:
    typer.echo(on_a_screen(message), err=True)


def _what_failed(error: OSError) -> str:
    """Where and why, of an error that nobody has made a message of: a disk that is full while kernels are stored."""
    return ": ".join(str(each) for each in (error.filename, error.strerror or error) if each is not None)


if __name__ == "__main__":
    from experiments.__main__ import main as begin

    begin()
