"""The only part of emd_console that knows ROS: what it hears, what it asks for, its node."""
