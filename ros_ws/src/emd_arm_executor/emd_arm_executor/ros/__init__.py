"""The executor node and the node of the simulated robot."""
