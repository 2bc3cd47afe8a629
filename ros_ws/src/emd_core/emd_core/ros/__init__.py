"""The only part of emd_core that knows ROS: conversions, parameters, markers, workers."""
