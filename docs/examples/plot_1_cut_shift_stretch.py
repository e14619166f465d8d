"""
One step of a set: cut, shift, stretch
======================================

How a measurement, an impulse and time change one section of the set.

A target approaches head-on at 58 km/s from a range of about 5800 km. At first only a box of
positions and velocities is known. The angle of the line of sight is measured with an error of at
most 0.15 mrad.
"""

import matplotlib.pyplot as plt
import numpy as np

from infoset import AngleSensor, InformationSet, Model, SetModel, StateBox

known = StateBox(z_m=(-2e3, 2e3), x_m=(5.5e6, 6.1e6), vz_m_s=(-100.0, 100.0), vx_m_s=(-59e3, -57e3))
sensor = AngleSensor(
    period_s=0.5,
    error_at_nominal_range_rad=0.00015,
    error_at_zero_range_rad=0.00023,
    nominal_range_m=5.8e6,
)
model = SetModel(58e3, 0.5, known, sensor, disturbance_m_s2=0.005, sections=5, model=Model.PAPER)
information = InformationSet(model)
information

# %%
# A stage of a step is a list of sections. These functions draw the middle section of a stage in the
# (ω, α) plane, with the previous stage in grey.


def outline(stage):
    """Corners of the middle section, omega in µrad/s and alpha in mrad."""
    corners = stage[len(stage) // 2].omega_alpha[0].polygon()
    return np.vstack([corners, corners[:1]]) * [1e6, 1e3]


def draw(axes, title, now, before=None):
    if before is not None:
        axes.fill(*outline(before).T, facecolor="#eeeeee", edgecolor="#999999", linestyle="--")
    axes.fill(*outline(now).T, facecolor="#c6d9ec", edgecolor="#08306b")
    axes.set(title=title, xlabel="rate ω, µrad/s")


# %%
# The set after twenty steps. The true state starts at z = 300 m with a lateral velocity of 20 m/s:

z_m, vz_m_s = 300.0, 20.0
rng = np.random.default_rng(4)
for step in range(20):
    time_s = 0.5 * step
    alpha = (z_m + vz_m_s * time_s) / (5.8e6 - 58e3 * time_s)
    information.measure_angle(alpha + rng.uniform(-0.00015, 0.00015))
    information.predict()
information

# %%
# One step, drawn before and after each of its stages. The measurement has the maximum allowed
# error, so its band cuts off a large part of the section.

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
draw(panels[0], "measurement: cut", measured, predicted)
draw(panels[1], "impulse of 7.5 m/s: shift", shifted, measured)
draw(panels[2], "ten seconds: stretch", later, shifted)
panels[0].set_ylabel("angle α, mrad")
plt.show()

# %%
# The measurement is a band of α. The impulse k shifts the section by -k/x along ω, because it
# changes the velocity but not the position. Time shears the section, because a greater rate leads
# to a greater angle, and stretches it, because the same offset is a greater angle at a shorter
# range. The unknown acceleration adds a short segment at every step, which is too short to be
# visible here.
#
# Each section is an independent filter: it depends only on its range and on the history. A section
# at *any* range can therefore be computed exactly by replaying the measurements and impulses:

information.section_at(label_m=5.7e6).polygons

# %%
# `The interception of 1997 <../interception.html>`_ describes how the paper uses these sets.
