"""infoset pursuit: the orbital pursuit-evasion game, solved, certified, and flown with feedback."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from experiments.common.display_units import M_PER_KM
from experiments.common.options import Html, Json, Out, Overwrite, ProblemName, Quiet, Seed, whole_number

if TYPE_CHECKING:
    from experiments.pursuit.file import PursuitProblem
    from experiments.pursuit.report import Feedback
    from rendezvous.pursuit_evasion import Certificate, Solution, Steering

FIGURES = ("figure-orbits", "figure-relative", "figure-control", "figure-distance")
FEEDBACK_FIGURE = "figure-feedback"
MOST_RUNS = 10_000
REPLAN_S, LEAST_PLANS, MOST_PLANS = 600.0, 50, 2000
"""Time between plans, and how many a game is given at least where the time is not asked for, and at most."""
LONGEST_SCRIPT = 100_000
"""Characters; less than the longest field that a reader of CSV takes."""
OPTIMAL, RANDOM = "optimal", "random"

Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="A value in place of the file's: evader.thrust_N=5; repeatable."),
]


def pursuit(
    problem: ProblemName = "geo-pursuit",
    settings: Settings = None,
    certify: Annotated[
        bool,
        typer.Option("--certify", help="Look in all directions too, for a branch that keeps the evader farther away."),
    ] = False,
    feedback: Annotated[
        str | None,
        typer.Option(
            "--feedback",
            metavar="POLICY",
            help="Fly a pursuer that plans anew against an evader that is optimal, random, coast, prograde, "
            "retrograde, normal, antinormal, outward, inward, or a CSV file of time_s,policy.",
        ),
    ] = None,
    replan: Annotated[
        float | None,
        typer.Option(
            "--replan-s",
            metavar="S",
            help="Time between plans; 600, or less for a game of less than 30 000 s, which gets 50 plans.",
        ),
    ] = None,
    delay: Annotated[float, typer.Option("--delay-s", metavar="S", help="Age of what the pursuer sees.")] = 0.0,
    position_noise: Annotated[
        float, typer.Option("--position-noise-m", metavar="M", help="Its standard deviation, a component.")
    ] = 0.0,
    velocity_noise: Annotated[
        float, typer.Option("--velocity-noise-m-s", metavar="M/S", help="Its standard deviation, a component.")
    ] = 0.0,
    runs: Annotated[int, typer.Option("--runs", metavar="N", help="Flights with feedback, each drawn anew.")] = 1,
    seed: Seed = 0,
    out: Out = None,
    json_: Json = None,
    html: Html = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Solve a game of two spacecraft: one hastens the capture, the other delays it, both as well as can be.

    Every capture comes with a certificate; a saddle point is claimed only where all its checks hold. Without --out,
    --json or --html nothing is written.
    """
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_json
    from experiments.common.page_document import page_path
    from experiments.common.screen import figure_files, say_warnings, tell_of_compiling_pursuit
    from experiments.pursuit.report import report_json

    page_path("--html", html)
    whole_number("--runs", runs, 1, MOST_RUNS, 100)
    whole_number("--seed", seed, 0, None, 0)
    _check_feedback_options(feedback, replan, delay, position_noise, velocity_noise, runs)
    given = problem_with(problem, settings)
    steerings = None if feedback is None else _steerings(feedback, seed)
    names = [*FIGURES, FEEDBACK_FIGURE] if feedback is not None else [*FIGURES]
    files = ("problem.toml", "results.json", *figure_files(*names))
    with checked_destinations(folder=out, names=files, files={"--json": json_, "--html": html}, overwrite=overwrite):
        say_warnings(given.warnings(), quiet)
        tell_of_compiling_pursuit(quiet)
        solution, certificate, elapsed_s = _solve(given, certify, quiet)
        flown = None
        if steerings is not None and feedback is not None:
            every_s = _time_between_plans(solution, replan)
            flown = _fly(
                solution, given, steerings, feedback, every_s, delay, position_noise, velocity_noise, runs, seed, quiet
            )
        json_text = to_json(report_json(given, solution, certificate, flown, elapsed_s))
        if html is not None:
            _write_page(html, given, solution, overwrite)
        deliver(json_, json_text, overwrite=overwrite)
        if out is not None:
            _fill(out, given, solution, flown, json_text, overwrite)
    if not quiet:
        _show(given, solution, certificate, flown, str(json_) == STDOUT)


def _write_page(file: Path, problem: PursuitProblem, solution: Solution, overwrite: bool) -> None:
    from experiments.common.errors import InputError
    from experiments.common.output import write_file
    from experiments.pursuit.page import pursuit_page

    if solution.capture is None and solution.fallback is None:
        raise InputError(
            f"--html: a game that ends as {solution.verdict.value} has no flight to show; leave --html out"
        )
    description = problem.tables.description or ""
    write_file(file, pursuit_page(problem.name, description, solution), overwrite=overwrite)


def problem_with(name: str, settings: Sequence[str] | None) -> PursuitProblem:
    """Read a problem, and set the values that the options give.

    Parameters
    ----------
    name : str
        A built-in name or a path.
    settings : sequence of str or None
        KEY=VALUE each.

    Returns
    -------
    PursuitProblem

    Raises
    ------
    InputError
        If there is no such problem or key, or it is not sound.
    """
    from experiments.common.errors import InputError
    from experiments.common.toml_values import shown
    from experiments.pursuit.file import load_pursuit

    values: dict[str, str] = {}
    for setting in settings or ():
        key, mark, value = setting.partition("=")
        if not mark or not key.strip() or not value.strip():
            raise InputError(f"--set: must be KEY=VALUE, found {shown(setting)}; for example --set evader.thrust_N=5")
        if key.strip() in values:
            raise InputError(f"--set: {key.strip()} is set twice; set each key once")
        values[key.strip()] = value.strip()
    return load_pursuit(name).with_values(values)


def _check_feedback_options(
    feedback: str | None, replan: float | None, delay: float, position: float, velocity: float, runs: int
) -> None:
    from experiments.common.errors import InputError

    if replan is not None and not (math.isfinite(replan) and replan >= 1.0):
        raise InputError(f"--replan-s: must be at least 1, found {replan:g}; for example --replan-s 600")
    for option, value in (
        ("--delay-s", delay),
        ("--position-noise-m", position),
        ("--velocity-noise-m-s", velocity),
    ):
        if not (math.isfinite(value) and value >= 0.0):
            raise InputError(f"{option}: must be 0 or more, found {value:g}; for example {option} 10")
    if feedback is None and (runs > 1 or delay > 0.0 or position > 0.0 or velocity > 0.0 or replan is not None):
        said = "--runs, --replan-s, --delay-s and noises are of feedback; add a policy, for example --feedback random"
        raise InputError(said)


def _time_between_plans(solution: Solution, asked_s: float | None) -> float:
    """Return how often to plan: often enough for a short game, not so often that a long one never ends."""
    from experiments.common.errors import InputError

    if solution.capture is None:
        return REPLAN_S if asked_s is None else asked_s
    game_s = solution.capture.time_s
    if asked_s is None:
        return max(min(REPLAN_S, game_s / LEAST_PLANS), game_s / MOST_PLANS)
    if asked_s * MOST_PLANS < game_s:
        raise InputError(
            f"--replan-s: {asked_s:g} makes more than {MOST_PLANS} plans in a game of {game_s:.6g} s; "
            f"make it {game_s / MOST_PLANS:.3g} or more"
        )
    return asked_s


def _steerings(policy: str, seed: int) -> Any:
    """Return the evader's steering of a run, by the number of the run and the time between plans."""
    from experiments.common.options import choice
    from rendezvous.pursuit_evasion import Policy, RandomSteering

    if policy.endswith(".csv"):
        script = _script(policy)
        return lambda _run, _hold_s: script
    name = choice("--feedback", policy, [OPTIMAL, RANDOM, *(each.value for each in Policy)])
    if name == OPTIMAL:
        return lambda _run, _hold_s: None
    if name == RANDOM:
        return lambda run, hold_s: RandomSteering(seed, run, hold_s)
    return lambda _run, _hold_s: Policy(name).direction


def _script(path: str) -> Steering:
    """Read a script: lines of time_s,policy."""
    import csv

    from experiments.common.errors import InputError
    from experiments.common.options import choice
    from experiments.common.toml_values import shown
    from rendezvous.pursuit_evasion import Policy, Script

    example = "write lines as 0,coast and 3600,prograde"
    try:
        with Path(path).open(encoding="utf-8", newline="") as file:
            text = file.read(LONGEST_SCRIPT + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "it is not UTF-8 text"
        raise InputError(f"--feedback: {path} cannot be read: {reason}; {example}") from None
    if len(text) > LONGEST_SCRIPT:
        raise InputError(
            f"--feedback: {path} is over {LONGEST_SCRIPT // 1000} kB, far more than a script needs; {example}"
        )
    times, policies = [], []
    for number, row in enumerate(csv.reader(text.splitlines()), start=1):
        if not row or (number == 1 and row[0].strip() == "time_s"):
            continue
        where = f"--feedback: {path}, line {number}"
        if len(row) != 2:
            raise InputError(f"{where}: must be a time and a policy, found {len(row)} values; {example}")
        try:
            time_s = float(row[0])
        except ValueError:
            time_s = math.nan
        if not math.isfinite(time_s):
            raise InputError(f"{where}: {shown(row[0])} is no time in seconds; {example}")
        times.append(time_s)
        policies.append(Policy(choice(where, row[1].strip(), [each.value for each in Policy])))
    try:
        return Script(tuple(times), tuple(policies))
    except ValueError as error:
        raise InputError(f"--feedback: {path}: {error}; {example}") from None


def _solve(problem: PursuitProblem, all_directions: bool, quiet: bool) -> tuple[Solution, Certificate | None, float]:
    from time import perf_counter

    from experiments.common.errors import InputError
    from experiments.common.screen import progress_bar
    from rendezvous.pursuit_evasion import certify, solve

    began_s = perf_counter()
    with progress_bar(quiet) as begin:
        report = begin("solve")
        try:
            solution = solve(problem.game(), all_directions=all_directions)
        except ValueError as error:
            raise InputError(f"{problem.source}: {error}; correct the problem") from None
        report(0.5)
        certificate = None if solution.capture is None else certify(solution, all_directions=all_directions)
        report(1.0)
    return solution, certificate, perf_counter() - began_s


def _fly(
    solution: Solution,
    problem: PursuitProblem,
    steerings: Any,
    policy: str,
    replan_s: float,
    delay_s: float,
    position_noise_m: float,
    velocity_noise_m_s: float,
    runs: int,
    seed: int,
    quiet: bool,
) -> Feedback | None:
    from experiments.common.errors import InputError
    from experiments.common.screen import progress_bar, say
    from experiments.pursuit.report import Feedback
    from rendezvous.pursuit_evasion import Observation, PathError, fly_many

    if solution.capture is None:
        say(f"no feedback: a game that ends as {solution.verdict.value} gives no plan to begin with", quiet)
        return None
    seen = Observation(delay_s, position_noise_m, velocity_noise_m_s)
    with progress_bar(quiet) as begin:
        try:
            flights = fly_many(
                problem.game(),
                lambda run: steerings(run, replan_s),
                runs,
                replan_s=replan_s,
                observation=seen,
                seed=seed,
                progress=begin("feedback"),
                solution=solution,
            )
        except PathError as error:
            raise InputError(f"--feedback: {error}; choose another policy, or check the units of the problem") from None
    return Feedback(policy, replan_s, delay_s, position_noise_m, velocity_noise_m_s, seed, tuple(flights))


def _fill(
    folder: Path,
    problem: PursuitProblem,
    solution: Solution,
    feedback: Feedback | None,
    json_text: str,
    overwrite: bool,
) -> None:
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures, write_file
    from experiments.pursuit.figures import draw_control, draw_distance, draw_feedback, draw_orbits, draw_relative
    from rendezvous.pursuit_evasion import history

    write_file(folder / "problem.toml", problem.to_toml(), overwrite=overwrite)
    write_file(folder / "results.json", json_text, overwrite=overwrite)
    figures = {}
    if solution.capture is not None:
        sampled = history(solution)
        figures["figure-orbits"] = draw_orbits(sampled)
        figures["figure-relative"] = draw_relative(sampled)
        figures["figure-control"] = draw_control(sampled)
    if len(solution.curve.duration_s) > 1:
        figures["figure-distance"] = draw_distance(solution)
    if feedback is not None:
        figures[FEEDBACK_FIGURE] = draw_feedback(solution, feedback.flights)
    for name, figure in figures.items():
        with reporting_failures(folder):
            save_figure(figure, folder, name)


def _show(
    problem: PursuitProblem,
    solution: Solution,
    certificate: Certificate | None,
    feedback: Feedback | None,
    stdout_taken: bool,
) -> None:
    """Print the verdict, the players, the certificate and the flights."""
    from rich.table import Table
    from rich.text import Text

    from experiments.common.screen import table_console

    console = table_console(stdout_taken)
    console.print(Text(f"{problem.name}: {_verdict(solution)}"), soft_wrap=True)
    capture = solution.capture
    if capture is not None:
        table = Table("player", box=None, pad_edge=False)
        for title in ("propellant\nkg", "final velocity\nkm/s"):
            table.add_column(title, justify="right")
        for name, end in (("pursuer", capture.pursuer), ("evader", capture.evader)):
            velocity = ", ".join(f"{each / M_PER_KM:.9f}" for each in end.velocity_m_s)
            table.add_row(name, f"{end.propellant_kg:.8f}", velocity)
        console.print(table)
        console.print(Text(f"where, km: {', '.join(f'{each / M_PER_KM:.6f}' for each in capture.position_m)}"))
        console.print(Text(f"direction: {', '.join(f'{each:.9f}' for each in capture.direction)}"))
        curvature = ", ".join(f"{each:.5f}" for each in capture.curvature)
        console.print(Text(f"closing speed {capture.closing_speed_m_s / M_PER_KM:.10f} km/s, curvature {curvature}"))
    if certificate is not None:
        _show_certificate(console, certificate)
    if feedback is not None:
        _show_feedback(console, feedback)


def _verdict(solution: Solution) -> str:
    from rendezvous.pursuit_evasion import Verdict

    until = f"{solution.looked_at_s:.1f} s" if solution.looked_at_s >= 1.0 else f"{solution.looked_at_s:.3g} s"
    if solution.capture is not None and solution.verdict is Verdict.CAPTURED:
        return f"captured at {solution.capture.time_s:.6f} s ({solution.route.value})"
    if solution.verdict is Verdict.PROPELLANT_EXHAUSTED:
        return f"propellant-exhausted: the {solution.exhausted}'s, after {until}; until then the evader keeps away"
    if solution.verdict is Verdict.ESCAPES:
        why = f"the {solution.exhausted}'s propellant is spent" if solution.exhausted else "the time looked at ends"
        return f"escapes: the evader keeps away until {why}, {until}"
    if solution.looked_at_s == 0.0:
        return "branch-not-certified: not even a short game can be followed; is everything in the units of its key?"
    text = f"branch-not-certified: the extremals are a saddle up to a duration of {until}; nothing is claimed beyond"
    if solution.fallback is not None and solution.fallback_route is not None:
        text += (
            f" (another route, {solution.fallback_route.value}, finds an extremal at {solution.fallback.time_s:.3f} s)"
        )
    return text


def _show_certificate(console: Any, certificate: Certificate) -> None:
    from rich.text import Text

    lines = [
        f"residual {certificate.residual:.1e}, Hamiltonian within {certificate.hamiltonian_drift:.1e}, "
        f"second integrator within {certificate.integrator_gap_m:.2g} m",
        f"no earlier capture on the way: {'yes' if certificate.no_earlier_capture else 'not known'}; least distance "
        f"from the planet's centre {certificate.least_distance_m / M_PER_KM:.1f} km",
    ]
    if certificate.pursuer_alone_s is not None:
        lines.append(f"pursuer deviates, evader as planned: captures at {certificate.pursuer_alone_s:.3f} s at best")
    answers = [
        f"{each.name} {each.capture_s:.1f} s" if each.capture_s is not None else f"{each.name}: not known"
        for each in certificate.evader_deviations
    ]
    if answers:
        lines.append(f"evader deviates, pursuer answers: {', '.join(answers)}")
    if certificate.directions_tried:
        excess = certificate.greatest_excess_m
        told = "nothing found" if excess is None else f"{excess:.2g} m beyond the capture radius at most"
        lines.append(
            f"directions: {certificate.directions_found} of {certificate.directions_tried} compared, {told}, "
            f"tolerance {certificate.excess_tolerance_m:.2g} m"
        )
        if missing := certificate.directions_tried - certificate.directions_found:
            lines.append(f"the other {missing} say nothing: no farthest extremal of both craft was found along them")
    against = "; ".join(certificate.failures)
    lines.append(f"saddle point: {f'not claimed: {against}' if against else 'all checks hold'}")
    for line in lines:
        console.print(Text(f"  {line}"), soft_wrap=True)


def _show_feedback(console: Any, feedback: Feedback) -> None:
    from rich.text import Text

    from rendezvous.pursuit_evasion import Ended, capture_quantiles_s

    flights = feedback.flights
    said = f"feedback, plans every {feedback.replan_s:g} s, evader {feedback.policy}: "
    if len(flights) == 1:
        (flight,) = flights
        said += f"{flight.ended.value} at {flight.time_s:.1f} s, {flight.distance_m:.4g} m apart; predicted last "
        said += f"{flight.predicted_s[-1]:.1f} s"
    else:
        caught = sum(flight.ended is Ended.CAPTURED for flight in flights)
        said += f"{caught} of {len(flights)} captured"
        quantiles = capture_quantiles_s(flights)
        if quantiles:
            said += "; capture time, s: least {:.1f}, 10 % {:.1f}, median {:.1f}, 90 % {:.1f}, greatest {:.1f}".format(
                *quantiles
            )
    console.print(Text(said), soft_wrap=True)
