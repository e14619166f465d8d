"""
A guaranteed rendezvous: how near for certain, and safe if the engines fail?
============================================================================

A craft approaches its target by ten impulses. Its start, its engine and its position sensor have
bounded errors, and nothing is assumed about their distribution. How near does it come for certain?

The numbers below are certificates: they follow from the plan, not from the solver that found it.
``approach-guaranteed`` is the spacecraft of the ARCH competition.
"""

import matplotlib.pyplot as plt
import numpy as np

from infoset import load_problem
from infoset.rendezvous.reachability import (
    PassiveSafety,
    affine_plan,
    answered_plan,
    drift_certificate,
    independent_parts,
    lower_bound,
    safe_plan,
)

noises_m = np.array([1.0, 3.0, 10.0])
affine_m = []
answered_m = []
bounds_m = []
for noise_m in noises_m:
    problem = load_problem("approach-guaranteed", [f"sensor.position_error_m={noise_m}"])
    # The benchmark is planar: its motion along the orbit's normal rests, and is left out.
    (part,) = independent_parts(problem.output_problem)
    affine_m.append(affine_plan(part.problem, window=3).guarantee)
    answered_m.append(answered_plan(part.problem, window=3).guarantee)
    bounds_m.append(lower_bound(part.problem).value)
    print(
        f"position known to {noise_m:g} m: {affine_m[-1]:.4g} m with affine feedback, "
        f"{answered_m[-1]:.4g} m with a last impulse that answers all measurements, "
        f"not less than {bounds_m[-1]:.4g} m"
    )

figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
axes.loglog(noises_m, affine_m, "o-", color="#3f6f9f", label="affine feedback")
axes.loglog(noises_m, answered_m, "s-", color="#e6842a", label="last impulse answers")
axes.loglog(noises_m, bounds_m, "--", color="#1a1a1a", label="no strategy guarantees less")
axes.set(xlabel="error of the measured position, m", ylabel="certain distance at the end, m")
axes.set_xticks(noises_m, [f"{noise_m:g}" for noise_m in noises_m])
axes.set_yticks([3.0, 6.0, 12.0], ["3", "6", "12"])
axes.minorticks_off()
axes.legend()
plt.show()

# %%
# Flights to a hold point 150 m behind a station in low orbit, ``safe-approach``. If the engines
# fail after an impulse, the craft drifts on. The best plan may then drift through the ball of 60 m
# about the station; the best plan with ``[passive_safety]`` stays outside for all errors, and
# guarantees as much.

problem = load_problem("safe-approach")
coasting = problem.drifts
keep_out_m = problem.passive_safety.keep_out_m
free = drift_certificate(affine_plan(problem.output_problem, window=3), coasting)
safe = safe_plan(problem.output_problem, PassiveSafety(coasting, keep_out_m), window=3)
for name, found in (("without", free), ("with", safe)):
    print(
        f"{name} passive safety: {found.plan.guarantee:.4g} m at the end, drifts at least "
        f"{found.least_distance:.4g} m from the station"
    )

# %%
# Each thin line is the drift after one impulse, in 50 flights with errors at their bounds.

errors = np.random.default_rng(1).choice([-1.0, 1.0], (50, safe.tube.errors.size))
turn = np.linspace(0.0, 2.0 * np.pi, 181)
thin = {"color": "#e6842a", "linewidth": 0.4, "alpha": 0.4}
figure, panels = plt.subplots(2, 1, figsize=(7, 6.6), sharex=True, layout="constrained")
for axes, name, found in zip(panels, ("without", "with"), (free, safe), strict=True):
    axes.fill(keep_out_m * np.cos(turn), keep_out_m * np.sin(turn), color="#f0e6d8")
    drifts = found.tube.middles + np.einsum("kicz,fz->fkic", found.tube.columns, errors)
    lines = drifts.reshape(-1, *drifts.shape[2:])
    axes.plot(lines[..., 1].T, lines[..., 0].T, **thin)
    path = found.plan.nominal_states
    aim = found.plan.problem.aim
    axes.plot(path[:, 1], path[:, 0], "o", color="#08306b", markersize=4, label="impulses")
    axes.plot(aim[1], aim[0], "*", color="#2f6b3a", markersize=10, label="hold point")
    axes.set(xlim=(-1100, 150), ylim=(-300, 250), aspect="equal", ylabel="radially outward, m")
    axes.set_title(f"{name} passive safety")
axes.set_xlabel("along the motion, m")
axes.legend(loc="upper left")
plt.show()

# %%
# ``infoset reach safe-approach`` does the same, and simulates flights: `Guaranteed rendezvous
# <../guaranteed-rendezvous.html>`_ has the theorems and their proofs.
