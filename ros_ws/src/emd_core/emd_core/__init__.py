"""What the packages of the folding cell share; nothing here imports ROS but the `ros` folder."""
