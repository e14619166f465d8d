"""
An observer of your own system
==============================

The exact sets of position and speed of a vehicle that measures its position, through a tunnel
without measurements.

The error of a measurement is at most 3 m. The acceleration is known to 0.4 m/s². Nothing is assumed
about the distribution of the errors.
"""

import matplotlib.pyplot as plt
import numpy as np

from infoset import LinearObserver, Zonotope

state_matrix = np.array([[1.0, 0.5], [0.0, 1.0]])
disturbance = np.array([0.05, 0.2])
observer = LinearObserver(
    state_matrix,
    [[1.0, 0.0]],
    Zonotope.box([-10.0, 0.0], [10.0, 20.0]),
    noise=3.0,
    disturbance=Zonotope([0.0, 0.0], [disturbance]),
)

# %%
# A simulated drive. NaN is a missing measurement.

rng = np.random.default_rng(2)
state, states, measurements = np.array([0.0, 12.0]), [], []
for step in range(30):
    states.append(state)
    measurements.append([np.nan if 12 <= step < 20 else state[0] + rng.uniform(-3.0, 3.0)])
    state = state_matrix @ state + rng.uniform(-1.0, 1.0) * disturbance
states = np.array(states)
estimates = observer.run(measurements)
estimates[-1].polygons

# %%
# What the later measurements imply about earlier states:

smoothed = observer.smooth(estimates)

figure, (plane, speed) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for estimate, better in zip(estimates[10:24:3], smoothed[10:24:3], strict=True):
    plane.fill(*estimate.polygons.polygon().T, facecolor="#c6d9ec", edgecolor="#3f6f9f")
    plane.fill(*better.polygons.polygon().T, facecolor="none", edgecolor="#e6842a")
plane.plot(*states[10:24:3].T, "x", color="#08306b")
plane.set(xlabel="position, m", ylabel="speed, m/s", title="sets every 1.5 s")
steps = np.arange(30)
for sets, colour in ((estimates, "#3f6f9f"), (smoothed, "#e6842a")):
    lower, upper = (
        np.array([getattr(each, end)[1] for each in sets]) for end in ("lower", "upper")
    )
    speed.fill_between(steps, lower, upper, color=colour, alpha=0.35)
speed.plot(steps, states[:, 1], color="#08306b")
speed.set(
    xlabel="step",
    ylabel="speed, m/s",
    ylim=(5, 20),
    title="bounds of the speed: filtered, smoothed",
)
plt.show()

# %%
# If a measurement contradicts the model, the set becomes empty. The observer tells the step and the
# excess.

measurements[25] = [measurements[25][0] + 20.0]
again = LinearObserver(
    state_matrix,
    [[1.0, 0.0]],
    Zonotope.box([-10.0, 0.0], [10.0, 20.0]),
    noise=3.0,
    disturbance=Zonotope([0.0, 0.0], [disturbance]),
)
again.run(measurements)
again.inconsistency
