"""The EMD net and the planner that searches it (paper, III); only the `ros` folder uses ROS."""

import os

# Threads of PyTorch that wait for each other sleep instead of spinning. The planner shares its
# cores with other nodes, and threads that spin while others want their core made a plan take four
# times as long. PyTorch reads this when it is imported, so it stands before anything else.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")
