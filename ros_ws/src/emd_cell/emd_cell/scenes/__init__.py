"""Synthetic scenes of the cell in which everything is known, to judge perception by."""
