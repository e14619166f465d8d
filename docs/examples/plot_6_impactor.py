"""
An impactor: which camera hits, and how early may its engine stop?
==================================================================

DART met Dimorphos at 6.14 km/s. It saw its target for four hours, and fired no impulse in the last
150 seconds.

``dart-2022`` is this mission in space. A camera that is a hundred times worse is the same file with
another error of a pixel. All runs of both missions have the same starts.
"""

import matplotlib.pyplot as plt
import numpy as np

from infoset import load_scenario, simulate

PIXELS_RAD = (5.4e-6, 5.4e-4)
missions = [load_scenario("dart-2022", [f"camera.pixel_error_rad={pixel}"]) for pixel in PIXELS_RAD]
results = [simulate(mission, runs=100) for mission in missions]
for mission, flown in zip(missions, results, strict=True):
    print(f"pixel error {mission.camera.pixel_error_rad:.1e} rad: {flown}")

# %%
# The plane across the approach: a point in the disc of the body is a hit. The dashed circle is the
# maximum guaranteed miss of the runs: it holds for every error within the bounds, not only for
# these.

turn = np.linspace(0.0, 2.0 * np.pi, 181)
circle = np.array([np.cos(turn), np.sin(turn)])
figure, panels = plt.subplots(1, 2, figsize=(9, 4.5), layout="constrained")
for axes, mission, flown in zip(panels, missions, results, strict=True):
    axes.fill(*mission.body.radius_m * circle, color="#f0e6d8")
    axes.plot(*flown.guaranteed_miss_m.max() * circle, color="#2f6b3a", linestyle="--")
    axes.plot(*flown.lateral_miss_m.T, ".", color="#3f6f9f")
    axes.set(xlabel="miss along y, m", ylabel="miss along z, m", aspect="equal")
    axes.set_title(
        f"pixel {1e6 * mission.camera.pixel_error_rad:.3g} µrad: {flown.hits.hits} of {len(flown)} "
        "hit"
    )
plt.show()

# %%
# The other question. The later the last impulse, the smaller the miss that is guaranteed, until the
# centroid error decides, which no later image removes.

cut_offs_s = np.array([30.0, 75.0, 150.0, 300.0, 600.0, 1200.0])
guaranteed_m = [
    simulate(
        load_scenario("dart-2022", [f"thruster.last_impulse_s={time_s}"]), runs=40
    ).guaranteed_miss_m
    for time_s in cut_offs_s
]
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
axes.plot(
    cut_offs_s,
    [bounds.max() for bounds in guaranteed_m],
    "o-",
    color="#08306b",
    label="maximum of 40 runs",
)
axes.axhline(missions[0].body.radius_m, color="#1a1a1a", linestyle="-.", label="radius of the body")
axes.set(
    xscale="log",
    xlabel="last impulse, s before the impact",
    ylabel="guaranteed miss Φ, m",
    ylim=(0, None),
)
axes.legend()
plt.show()

# %%
# ``infoset sweep`` decides such questions for a requirement and many values: `Impactors
# <../impactors.html>`_.
