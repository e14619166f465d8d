"""
A bound of the miss that is computed on board
=============================================

With the model ``guaranteed`` the set always contains the true state, and Phi is a bound of the true
miss.

The published sets can lose the true state by a small amount. The sets of the model ``guaranteed``
cannot. Phi is computed from the sets alone, without the true state.
"""

import matplotlib.pyplot as plt

from infoset import load_scenario, simulate

guaranteed = load_scenario("asteroid-1997", ["information_set.model=guaranteed", "noise=game"])
results = simulate(guaranteed, runs=60)
print(f"true state inside the set at every step: {results.truth_kept.sum()} of 60 runs")
print(f"miss at most Phi: {results.phi_held.sum()} of 60 runs")

# %%
# Each point is an engagement. A point above the line would violate the guarantee.

figure, axes = plt.subplots(figsize=(5.5, 4.5), layout="constrained")
axes.plot(
    results.guaranteed_miss_m,
    results.miss_m,
    "o",
    color="#08306b",
    markersize=4,
    label="engagement",
)
limit = 1.1 * float(results.guaranteed_miss_m.max())
axes.plot([0, limit], [0, limit], color="#8c1c13", label="miss = Phi")
axes.fill_between([0, limit], [0, limit], [limit, limit], color="#8c1c13", alpha=0.08)
axes.set(xlim=(0, limit), ylim=(0, limit), xlabel="guaranteed miss Phi, m", ylabel="true miss, m")
axes.legend(loc="upper left")
plt.show()

# %%
# `The guarantee <../guarantee.html>`_ states the assumptions on sensors, engine and target, and the
# proof.
