"""`infoset pursuit`: computation."""

from __future__ import annotations

import numpy as np

from infoset.experiments.common.errors import InputError
from infoset.experiments.common.options import choice
from infoset.experiments.common.problem_command import ProblemCommand
from infoset.experiments.common.screen import BeginProgress, say
from infoset.experiments.pursuit.command import Pursuit
from infoset.experiments.pursuit.file import PursuitProblem
from infoset.experiments.pursuit.page import pursuit_page
from infoset.experiments.pursuit.report import (
    Feedback,
    PursuitReport,
    report_json,
    report_lines,
    trajectories,
)
from infoset.rendezvous.pursuit_evasion import (
    CaptureSolution,
    Observation,
    Policy,
    RandomSteering,
    Steering,
    certify,
    fly,
    solve,
)

OPTIMAL, RANDOM = "optimal", "random"
"""Policies of the evader besides those of `Policy`."""

REPLAN_S = 600.0
"""Default time between plans: some 150 in a revolution of a geostationary orbit."""
MIN_PLANS = 50
"""Smallest number of plans in a game by default; chosen for short games, as in low orbits."""
MAX_PLANS = 2000
"""Largest number of plans in a game by default: at 2 to 4 ms each, a run takes some seconds."""


def solve_pursuit(problem: PursuitProblem, options: Pursuit, begin: BeginProgress) -> PursuitReport:
    """Return the solution of the game with its certificate, and the simulations with feedback."""
    changed = (options.delay_s, options.position_noise_m, options.velocity_noise_m_s)
    if options.feedback is None and (
        options.runs > 1 or any(changed) or options.replan_s is not None
    ):
        raise InputError(
            "--runs, --replan-s, --delay-s and the noise options need a policy of the evader; "
            "add one, for example --feedback random"
        )
    if options.feedback is not None:
        choice(
            "--feedback", options.feedback, [OPTIMAL, RANDOM, *(policy.value for policy in Policy)]
        )
    progress = begin("solve")  # its shares are chosen
    solution = solve(problem.game, all_directions=options.certify)
    progress(0.5)
    certificate = None
    if solution.capture is not None:
        certificate = certify(solution, all_directions=options.certify)
    progress(1.0)

    feedback = None
    if options.feedback is not None:
        feedback = _fly(solution, options, options.feedback, begin)
    return PursuitReport(problem, solution, certificate, feedback)


def _fly(
    solution: CaptureSolution, options: Pursuit, policy: str, begin: BeginProgress
) -> Feedback | None:
    """Simulate the pursuer with feedback against a policy; None if there is no capture."""
    if solution.capture is None:
        say("no feedback: there is no capture, and so no plan to start from", options.quiet)
        return None
    game_s = solution.capture.time_s
    # The option is at least 1 s, never zero.
    replan_s = options.replan_s or max(min(REPLAN_S, game_s / MIN_PLANS), game_s / MAX_PLANS)
    observation = Observation(options.delay_s, options.position_noise_m, options.velocity_noise_m_s)

    def steering(run: int) -> Steering | None:
        if policy == RANDOM:
            return RandomSteering(options.seed, run, replan_s)
        return None if policy == OPTIMAL else Policy(policy).direction

    # The errors have the streams (run, 0) of the seed, `RandomSteering` those of (run, 1, draw).
    flights = []
    progress = begin("feedback")
    for run in range(options.runs):
        flights.append(
            fly(
                solution.game,
                steering(run),
                replan_s=replan_s,
                observation=observation,
                seed=np.random.SeedSequence(entropy=options.seed, spawn_key=(run, 0)),
                solution=solution,
            )
        )
        progress((run + 1) / options.runs)
    return Feedback(policy, replan_s, observation, options.seed, tuple(flights))


COMMAND = ProblemCommand(
    owner=PursuitProblem,
    solve=solve_pursuit,
    to_json=report_json,
    to_csv=trajectories,
    lines=report_lines,
    to_html=pursuit_page,
    figures="infoset.experiments.pursuit.figures",
    figure_names=(
        "figure-orbits",
        "figure-relative",
        "figure-control",
        "figure-distance",
        "figure-feedback",
    ),
)
run = COMMAND.run
