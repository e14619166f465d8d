"""
The closing of the predicted miss
=================================

What guidance reads off the set is one interval: the misses that are still possible if nothing more is done.

Its ends are pi_* and pi^*, reached in two corners of the set. The symmetric-miss strategy keeps the interval symmetric
about zero, so that the worse of its ends is as small as it can be.
"""

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from experiments import load_scenario
from guidance import NoiseKind
from sim import fly_one

scenario = replace(load_scenario("asteroid-1997-single"), range_sensor=None)
flights = {
    "random errors": fly_one(scenario),
    "errors that play a game": fly_one(replace(scenario, noise=NoiseKind.GAME)),
}

# %%
# The paper's single engagement: 8 km aside, 100 s to go, impulses of up to 7.5 m/s. The interval shrinks by four
# orders of magnitude, so that the axis is logarithmic outside of +-10 m.

figure, panels = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
for axes, (title, record) in zip(panels, flights.items(), strict=True):
    known = [step for step in record.steps if step.predicted_miss_m is not None]
    times = [step.time_s for step in known]
    lower, upper = np.array([step.predicted_miss_m for step in known]).T
    axes.fill_between(times, lower, upper, color="#c6d9ec", edgecolor="#08306b", label="predicted-miss interval")
    axes.axhline(0.0, color="#1a1a1a", linewidth=0.8)
    axes.set_yscale("symlog", linthresh=10.0)
    axes.set(title=f"{title}: misses by {record.result.miss_m[0]:.1f} m", xlabel="time t, s")
    axes.legend(loc="upper right")
panels[0].set_ylabel("predicted miss, m")
plt.show()

# %%
# At first the interval is as wide as what is known at the start, and symmetric: nothing is to be corrected yet. Once a
# measurement cuts off one end, impulses at their limit bring zero back into the middle. From then on it is measurements
# that close it. Random errors now and then come close to their bounds and cut the set; errors that play a game are
# chosen so that the worst corner of the set stays in it, and the interval closes late:

for title, record in flights.items():
    spent = np.abs([step.impulse_m_s for step in record.steps]).sum()
    print(f"{title}: miss {record.result.miss_m[0]:.1f} m, impulse {spent:.0f} m/s")

# %%
# The sets themselves half a second, four and eight seconds after the start: the paper's figure 3, drawn by the function
# that ``infoset engage`` uses. Crosses are the truth, which is inside, squares the measured angles.

from experiments.interception.figures.sets import draw_sets

library_figure = draw_sets(list(flights.values()))
