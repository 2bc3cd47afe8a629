"""Cloth on a desk: small-step XPBD with self-contact, manipulations, replay, data generation."""
