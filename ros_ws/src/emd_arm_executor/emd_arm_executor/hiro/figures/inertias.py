"""Masses and inertia tensors of HIRO's links, from the OpenHRP model in hironx-interface.

That model has the only complete set.
"""

from __future__ import annotations

from emd_arm_executor.hiro.figures.joints import mirror_vector
from emd_arm_executor.hiro.figures.records import Inertia

# Mass of the fingers: the models' placeholder (10 g each, far too large a tensor, harmless here).
FINGER_INERTIA = Inertia(0.01, (0, 0, 0), (1e-4, 1e-4, 1e-4, 0, 0, 0))

INERTIAS: dict[str, Inertia] = {
    "WAIST": Inertia(
        3.11081,
        (-0.00038809, 1.66e-06, 0.16466),
        (0.0347318, 0.0347482, 0.00438238, 5.78e-06, -3.342e-05, 6.25e-07),
    ),
    "CHEST_JOINT0_Link": Inertia(
        6.20761,
        (-0.00493378, -0.00097682, 0.344052),
        (0.0639575, 0.0310845, 0.0501107, -0.00022833, 0.00011172, 6.48e-05),
    ),
    "HEAD_JOINT0_Link": Inertia(
        0.317929,
        (-2.292e-05, 0.00547848, -0.00784016),
        (0.00027682, 0.00013009, 0.00020954, 3e-08, -3.3e-07, -1.092e-05),
    ),
    "HEAD_JOINT1_Link": Inertia(
        0.0808593,
        (5.02e-06, -0.0166777, 0.0163153),
        (8.07e-05, 3.025e-05, 6.637e-05, -3e-08, 0, -1.277e-05),
    ),
    "LARM_JOINT0_Link": Inertia(
        1.32626,
        (-0.00226388, -0.00521383, 0.0156081),
        (0.00207537, 0.00240295, 0.00141912, 0.00011276, 8.927e-05, -4.57e-05),
    ),
    "LARM_JOINT1_Link": Inertia(
        1.14898,
        (-5.236e-05, 0.0583134, -0.107061),
        (0.0154168, 0.0147117, 0.00126575, 9.75e-07, 3.515e-06, 0.00213705),
    ),
    "LARM_JOINT2_Link": Inertia(
        0.577518,
        (-2.254e-05, 0.00167107, -0.0715116),
        (0.00143966, 0.00141763, 0.0001972, -3e-07, 1.2e-06, -7.596e-05),
    ),
    "LARM_JOINT3_Link": Inertia(
        0.457418,
        (-1.788e-05, -0.00395812, -0.202731),
        (0.00069205, 0.00068903, 0.00013509, 3e-08, 5.2e-07, -1.915e-05),
    ),
    "LARM_JOINT4_Link": Inertia(
        0.418434,
        (0.00243131, 0.00379733, -0.0577036),
        (0.00052016, 0.00050569, 0.00014004, 1.69e-06, 7.9e-06, -5.377e-05),
    ),
    "LARM_JOINT5_Link": Inertia(
        1.05156,
        (-0.048476, -3.2e-06, -0.0388988),
        (0.00194072, 0.00209392, 0.00035788, 1.1e-07, -0.00042482, 1.2e-07),
    ),
}


def mirror_inertia(inertia: Inertia) -> Inertia:
    """Mirror a link's mass distribution in the plane y = 0."""
    ixx, iyy, izz, ixy, ixz, iyz = inertia.tensor
    tensor = (ixx, iyy, izz, -ixy, ixz, -iyz)
    return Inertia(inertia.mass, mirror_vector(inertia.centre), tensor)
