"""The EMD net and the planner that searches it (paper, III); only the `ros` folder uses ROS."""
