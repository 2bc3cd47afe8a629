"""Cloth on a desk: small-step XPBD with self-contact, manipulations, replay, data generation."""

from emd_cloth_sim.kernel_cache import use_own_folder

use_own_folder()
