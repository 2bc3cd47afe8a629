"""The EMD net and the planner that searches it (paper, III); only the `ros` folder uses ROS."""

import os

# Threads of PyTorch that wait for each other soon sleep instead of spinning on. The planner shares
# its cores with other nodes, and threads that spin while others want their core made a plan take
# twenty times as long; threads that never spin take two thirds longer on cores of their own.
# PyTorch reads this when it is imported, so it stands before anything else.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ["OMP_WAIT_POLICY"] = "PASSIVE"
    os.environ.setdefault("GOMP_SPINCOUNT", "3000")
