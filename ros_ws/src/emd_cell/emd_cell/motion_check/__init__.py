"""Random manipulations planned, carried out by a perfect robot, and audited."""
