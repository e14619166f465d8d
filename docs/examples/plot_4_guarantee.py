"""
A miss that is known on board
=============================

The published sets can lose the truth by a little. Those of the model ``guaranteed`` cannot, and so what leaves them
bounds the true miss: Phi is known on board, without knowing the truth.
"""

from dataclasses import replace

import matplotlib.pyplot as plt

from experiments import load_scenario
from guidance import NoiseKind
from infoset import InitialSet, Model
from sim import simulate

scenario = load_scenario("asteroid-1997")
model = replace(scenario.set_model, kind=Model.GUARANTEED, initial_set=InitialSet.BOX)
guaranteed = replace(scenario, set_model=model, noise=NoiseKind.GAME)
results = simulate(guaranteed, runs=60)
print(f"truth kept {results.truth_kept.sum()}/60, Phi held {results.phi_held.sum()}/60")

# %%
# Each point is an engagement. Above the line the miss would exceed what was promised.

figure, axes = plt.subplots(figsize=(5.5, 4.5), layout="constrained")
axes.plot(results.guaranteed_miss_m, results.miss_m, "o", color="#08306b", markersize=4, label="engagement")
limit = 1.1 * float(results.guaranteed_miss_m.max())
axes.plot([0, limit], [0, limit], color="#8c1c13", label="miss = Phi")
axes.fill_between([0, limit], [0, limit], [limit, limit], color="#8c1c13", alpha=0.08)
axes.set(xlim=(0, limit), ylim=(0, limit), xlabel="guaranteed miss Phi, m", ylabel="true miss, m")
axes.legend(loc="upper left")
plt.show()

# %%
# `The guarantee <../guarantee.html>`_ says what this assumes of sensors, engine and target, and proves it.
