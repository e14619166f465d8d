"""
A set that is cut, shifted and stretched
========================================

One step of guidance, as a section of the set sees it.

A target comes head-on at 58 km/s from some 5800 km. All that is known at first is a box of positions and velocities;
the angle of the line of sight is measured to within 0.15 mrad.
"""

import matplotlib.pyplot as plt
import numpy as np

from infoset import AngleSensor, InformationSet, SetModel, StateBox

known = StateBox(z_m=(-2e3, 2e3), x_m=(5.5e6, 6.1e6), vz_m_s=(-100.0, 100.0), vx_m_s=(-59e3, -57e3))
sensor = AngleSensor(
    period_s=0.5, error_at_nominal_range_rad=0.00015, error_at_zero_range_rad=0.00023, nominal_range_m=5.8e6
)
model = SetModel(58e3, 0.5, known, sensor, disturbance_m_s2=0.005, sections=5)
information = InformationSet(model)
information

# %%
# A stage of a step is a list of sections. This draws the middle one of each stage in the (omega, alpha) plane, the one
# before it in grey.


def outline(stage):
    """Corners of the middle section, omega in µrad/s and alpha in mrad."""
    corners = stage[len(stage) // 2].omega_alpha.polygon()
    return np.vstack([corners, corners[:1]]) * [1e6, 1e3]


def draw(axes, title, now, before=None):
    if before is not None:
        axes.fill(*outline(before).T, facecolor="#eeeeee", edgecolor="#999999", linestyle="--")
    axes.fill(*outline(now).T, facecolor="#c6d9ec", edgecolor="#08306b")
    axes.set(title=title, xlabel="rate ω, µrad/s")


# %%
# The set after some twenty steps, in which the truth was at z = 300 m and moved across at 20 m/s:

z_m, vz_m_s = 300.0, 20.0
rng = np.random.default_rng(4)
for step in range(20):
    time_s = 0.5 * step
    alpha = (z_m + vz_m_s * time_s) / (5.8e6 - 58e3 * time_s)
    information.measure_angle(alpha + rng.uniform(-0.00015, 0.00015))
    information.predict()
information

# %%
# Now one step, drawn before and after each of its parts. The angle that is measured here errs by its greatest error, so
# that the band cuts deep.

time_s = 10.0
alpha = (z_m + vz_m_s * time_s) / (5.8e6 - 58e3 * time_s)

predicted = information.sections()
information.measure_angle(alpha + 0.00015)
measured = information.sections()
information.shift(7.5)
shifted = information.sections()
for _ in range(20):
    information.predict()
later = information.sections()

figure, panels = plt.subplots(1, 3, figsize=(10, 3.6), layout="constrained")
draw(panels[0], "a measurement cuts", measured, predicted)
draw(panels[1], "an impulse of 7.5 m/s shifts", shifted, measured)
draw(panels[2], "ten seconds stretch", later, shifted)
panels[0].set_ylabel("angle α, mrad")
plt.show()

# %%
# The cut is a band of alpha. The shift is along omega by -k/x: an impulse changes a velocity, and not yet a position.
# Time shears the section, because a greater rate is a greater angle a moment later, and stretches it, because the
# same offset is a greater angle from nearer. The unknown acceleration adds a short segment at every step, too short
# to be seen here.
#
# Each section is a filter of its own: what happens to it depends on its range alone. That is why a section at *any*
# range can be had exactly, by replaying what was measured and done:

information.section_at(label_m=5.7e6).polygon

# %%
# `Sets, guarantee and limits <../interception.html>`_ says what the paper does with them.
