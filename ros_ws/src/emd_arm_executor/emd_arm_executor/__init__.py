"""From a manipulation of the cloth to safe, timed motions of two arms; no ROS outside `ros/`."""
