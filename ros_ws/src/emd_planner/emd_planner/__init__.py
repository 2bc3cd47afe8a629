"""The EMD net (paper, III) and the planner that searches it; nothing here imports ROS but `ros`."""
