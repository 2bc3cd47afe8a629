"""The parts of the cell that talk to the node graph."""
