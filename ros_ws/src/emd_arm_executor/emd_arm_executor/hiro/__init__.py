"""The HIRO robot: its model, its poses, and a simulated cell with table, cloth and camera."""
