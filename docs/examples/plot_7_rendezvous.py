"""
Rendezvous: where several craft meet, and one that visits two targets
=====================================================================

Three craft near a circular orbit choose the meeting point that is best for the group. A chaser then
visits two targets.

Both problems have exact solutions: quadratic costs, and linear motion in Hill's axes (x radially
outward, y along the motion, z along the orbit's normal).
"""

import matplotlib.pyplot as plt
import numpy as np

from infoset import load_problem
from infoset.experiments import draw_trajectories
from infoset.rendezvous.multipoint import TimeLimits, best_times
from infoset.rendezvous.pareto import solve_encounter

meeting = solve_encounter(load_problem("pareto-2008").encounter)
print("meeting at", meeting.meeting_state()[:3].round(1), "m")
for craft, squared, excess in zip(
    meeting.encounter.craft, meeting.cost_squared(), meeting.excess(), strict=True
):
    print(
        f"{craft.name}: cost {np.sqrt(squared):.1f}, alone {np.sqrt(squared - excess):.1f} m/s^1.5"
    )

# %%
# The flights to the meeting.

library_figure = draw_trajectories(meeting)

# %%
# A chaser that starts at rest flies by two drifting targets. The first time is free, the last one
# is given: moving the first visit saves control.

problem = load_problem("service-2")
order, times_s = (0, 1), np.array(problem.times_s)
given = problem.tour.fly(order, times_s)
best = best_times(problem.tour, order, TimeLimits(latest_s=times_s[-1]), [times_s])
print(
    f"cost {given.cost:.4g} with the given times, {best.path.cost:.4g} with the best ones: "
    f"{best.time_s.round(0)} s"
)

seconds = np.linspace(0.0, times_s[-1], 400)
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
for path, name, colour in ((given, "given times", "#3f6f9f"), (best.path, "best times", "#e6842a")):
    axes.plot(
        seconds, 1e3 * np.linalg.norm(path.control(seconds), axis=-1), color=colour, label=name
    )
axes.set(xlabel="time, s", ylabel="control, mm/s²")
axes.legend()
plt.show()

# %%
# `Where several craft meet <../pareto.html>`_ and `Visits <../multipoint.html>`_ have the theory
# and the commands.
