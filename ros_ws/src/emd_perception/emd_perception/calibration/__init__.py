"""Where the camera is: from a printed board on the table and the table's plane."""
