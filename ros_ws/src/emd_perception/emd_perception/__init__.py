"""From colour and depth images to the voxel grid of the cloth (paper, III-A and IV-B).

Everything here but the `ros` folder works without ROS.
"""
