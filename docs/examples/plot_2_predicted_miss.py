"""
The predicted miss during an engagement
=======================================

Guidance uses one interval from the set: the misses that are possible without further impulses.

Its ends are attained at two corners of the set. The symmetric-miss strategy keeps the interval
symmetric about zero, so that the greater modulus of its ends is as small as possible.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from infoset import fly_one, load_scenario
from infoset.guidance import NoiseKind

scenario = replace(load_scenario("asteroid-1997-single"), range_sensor=None)
flights = {
    "random errors": fly_one(scenario),
    "game noise": fly_one(replace(scenario, noise=NoiseKind.GAME)),
}

# %%
# The single engagement of the paper starts with a lateral offset of 8 km, 100 s before the meeting.
# Impulses are at most 7.5 m/s. The interval shrinks by four orders of magnitude, so the axis is
# logarithmic outside ±10 m.

figure, panels = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
for axes, (title, record) in zip(panels, flights.items(), strict=True):
    lower, upper = record.predicted_miss_m[:, 0].T
    axes.fill_between(
        record.time_s,
        lower,
        upper,
        color="#c6d9ec",
        edgecolor="#08306b",
        label="predicted-miss interval",
    )
    axes.axhline(0.0, color="#1a1a1a", linewidth=0.8)
    axes.set_yscale("symlog", linthresh=10.0)
    axes.set(title=f"{title}: miss {record.result.miss_m[0]:.1f} m", xlabel="time t, s")
    axes.legend(loc="upper right")
panels[0].set_ylabel("predicted miss, m")
plt.show()

# %%
# At first the interval is wide and symmetric, so no impulse is needed. When a measurement cuts off
# one end, impulses of the maximum size bring zero back to the middle. Afterwards measurements
# shrink the interval. Random errors are sometimes close to their bounds and then cut the set. Game
# noise is chosen so that the worst corner stays in the set, and the interval shrinks late:

for title, record in flights.items():
    spent = np.abs(record.impulse_m_s).sum()
    print(f"{title}: miss {record.result.miss_m[0]:.1f} m, impulse {spent:.0f} m/s")

# %%
# The sets 0.5 s, 4 s and 8 s after the start are figure 3 of the paper, drawn with the function
# that ``infoset engage`` uses. Crosses are the true state, which is inside; squares are the
# measured angles.

from infoset.experiments.interception.figures.sets import draw_sets

library_figure = draw_sets(list(flights.values()))
