"""
A face designed for damping
===========================

Which hills give a joint the loss factor that you want? Sweep the families, make the face, analyse
it back.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

import capslip
from capslip.analysis import analyze_families
from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface

WISH = 0.03  # loss factor of the joint at 20 N
HIGH, LOW, RADIUS_M = 3, 6, 24.0
GIVEN = (
    "contact.preload_N=460",
    "material.friction_coefficient=0.2",
    "answer.slip_force_N=20",
)

# %%
# Chosen is the step h between high and low hills. With a greater step the high ones bear more and
# the low ones less; these slip sooner, so the loss grows with h. Given families are answered for
# in milliseconds, so that a solver can search.


def loss_of_families(h_m):
    """Return the loss factor of a joint whose families are a step apart."""
    families = {"m": HIGH, "n": LOW, "radius_G_m": RADIUS_M, "radius_P_m": RADIUS_M, "h_m": h_m}
    sets = (f"families.{name}={value}" for name, value in families.items())
    settings = capslip.load_settings(overrides=(*GIVEN, *sets))
    return analyze_families(settings).answer.joint_loss_factor


def step_for(loss_factor):
    """Return the step at which the families lose as much as wanted."""
    return brentq(lambda h_m: loss_of_families(h_m) - loss_factor, 10e-9, 320e-9, xtol=1e-11)


# %%
# The families do not feel each other; the hills of a face do. So make the face, analyse its map
# with the model that the program itself chooses, and aim anew by what was missed. Two or three
# rounds are enough.


def face_of(h_m, shape=(200, 300)):
    """Return the map of a face of 60 x 40 mm with these families, and noise."""
    families = (CapFamily("G", HIGH, RADIUS_M), CapFamily("P", LOW, RADIUS_M, h_m))
    pixel_m = 0.04 / shape[0]
    scene = Scene(shape, (pixel_m, pixel_m), seed=3, families=families, noise_rms_m=1e-9)
    return synthetic_surface(scene)[0]


settings = capslip.load_settings(overrides=GIVEN)
aim, rounds = WISH, []
for _ in range(3):
    h_m = step_for(aim)
    found = capslip.analyze(face_of(h_m), settings)
    rounds.append((h_m, found.answer.joint_loss_factor))
    print(f"h {h_m * 1e9:.0f} nm: families {aim:.4f}, face {rounds[-1][1]:.4f}, wish {WISH}")
    aim *= WISH / found.answer.joint_loss_factor

# %%
# The last face, measured with pixels half as large, must keep what was wished for.

made = capslip.analyze(face_of(h_m, (400, 600)), settings)
got = made.answer.joint_loss_factor
print(f"loss factor {got:.4f}, off by {100 * abs(got / WISH - 1):.1f} % ({made.contact.model})")
assert abs(got / WISH - 1) < 0.1

# %%
steps_m = np.linspace(20e-9, 280e-9, 27)
figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
left.plot(steps_m * 1e9, [loss_of_families(h_m) for h_m in steps_m], label="families alone")
left.plot([h_m * 1e9 for h_m, _ in rounds], [loss for _, loss in rounds], "o", label="face made")
left.axhline(WISH, color="0.5", linestyle="--", label="wish")
left.set(xlabel="step h [nm]", ylabel="loss factor of the joint at 20 N")
left.legend()
made.plot.caps(ax=right)
plt.show()
