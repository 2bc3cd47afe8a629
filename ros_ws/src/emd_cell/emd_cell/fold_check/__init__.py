"""Random folds through all nodes of a simulated cell, compared with folds without a robot."""
