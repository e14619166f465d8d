"""`infoset pursuit`: computation, files and tables."""

from __future__ import annotations

from collections.abc import Callable
from time import perf_counter

from experiments.common.errors import InputError, input_errors
from experiments.common.input_file import to_toml
from experiments.common.output import TRAJECTORIES, output_of, to_json
from experiments.common.screen import figure_files, progress_bar, say, show
from experiments.pursuit.command import Pursuit
from experiments.pursuit.evader import EvaderPolicy, evader_policy
from experiments.pursuit.file import PursuitProblem, load_pursuit
from experiments.pursuit.page import pursuit_page
from experiments.pursuit.report import Feedback, Report, report_json, report_parts, saddle_point, trajectories
from rendezvous.pursuit_evasion import Observation, PathError, Solution, certify, fly_many, solve

FIGURES = ("figure-orbits", "figure-relative", "figure-control", "figure-distance", "figure-feedback")
REPLAN_S, MIN_PLANS, MAX_PLANS = 600.0, 50, 2000
"""Default time between plans, and the smallest and largest number of plans in a game."""

Begin = Callable[[str], Callable[[float], None]]


def run(options: Pursuit) -> None:
    """Solve the game, simulate it with feedback, write the files and print the results."""
    _check_feedback(options)
    problem = load_pursuit(options.problem, options.settings)
    evader = None if options.feedback is None else evader_policy(options.feedback, options.seed)
    names = FIGURES[:-1] if evader is None else FIGURES
    files = ("problem.toml", "results.json", TRAJECTORIES, *figure_files(*names))
    with output_of(options, files) as written, progress_bar(options.quiet) as begin:
        report = _solve(problem, options, evader, begin)
        solution = report.solution
        has_trajectory = solution.capture is not None
        wanted = " and ".join(option for option in ("--html", "--csv") if option in written.files)
        if wanted and not has_trajectory:
            raise InputError(
                f"{wanted}: there is no trajectory to show, the result is {solution.verdict.value}; omit {wanted}"
            )
        written.save("results.json", to_json(report_json(report)), "--json")
        if options.html is not None:
            claim = saddle_point(report.certificate)
            written.deliver("--html", pursuit_page(problem.name, problem.description, solution, claim))
        if written.wants("--csv") and has_trajectory:
            written.save(TRAJECTORIES, trajectories(solution), "--csv")
        if options.out is not None:
            from experiments.pursuit.figures import draw_all

            written.save("problem.toml", to_toml(problem))
            written.draw(FIGURES, draw_all(report), begin("figures"))
    show(report_parts(report), options.quiet, stdout_taken=written.stdout_taken)


def _check_feedback(options: Pursuit) -> None:
    changed = (options.delay_s, options.position_noise_m, options.velocity_noise_m_s)
    if options.feedback is None and (options.runs > 1 or any(changed) or options.replan_s is not None):
        raise InputError(
            "--runs, --replan-s, --delay-s and the noise options need a policy of the evader; "
            "add one, for example --feedback random"
        )


def _solve(problem: PursuitProblem, options: Pursuit, evader: EvaderPolicy | None, begin: Begin) -> Report:
    began_s, progress = perf_counter(), begin("solve")
    with input_errors(problem.name, "; correct the problem"):
        solution = solve(problem.game, all_directions=options.certify)
    progress(0.5)
    certificate = None if solution.capture is None else certify(solution, all_directions=options.certify)
    progress(1.0)
    elapsed_s = perf_counter() - began_s
    feedback = None if evader is None else _fly(solution, options, evader, begin)
    return Report(problem, solution, certificate, feedback, elapsed_s)


def _fly(solution: Solution, options: Pursuit, evader: EvaderPolicy, begin: Begin) -> Feedback | None:
    if solution.capture is None:
        say(f"no feedback: there is no plan to start from, the result is {solution.verdict.value}", options.quiet)
        return None
    replan_s = _time_between_plans(solution.capture.time_s, options.replan_s)
    observation = Observation(options.delay_s, options.position_noise_m, options.velocity_noise_m_s)
    try:
        flights = fly_many(
            solution.game,
            lambda run: evader(run, replan_s),
            options.runs,
            replan_s=replan_s,
            observation=observation,
            seed=options.seed,
            progress=begin("feedback"),
            solution=solution,
        )
    except PathError as error:
        raise InputError(f"--feedback: {error}; choose another policy, or check the units of the problem") from None
    return Feedback(str(options.feedback), replan_s, observation, options.seed, tuple(flights))


def _time_between_plans(game_s: float, asked_s: float | None) -> float:
    if asked_s is None:
        return max(min(REPLAN_S, game_s / MIN_PLANS), game_s / MAX_PLANS)
    if asked_s * MAX_PLANS < game_s:
        raise InputError(
            f"--replan-s: {asked_s:g} makes more than {MAX_PLANS} plans in a game of {game_s:.6g} s; "
            f"choose {game_s / MAX_PLANS:.3g} or more"
        )
    return asked_s
