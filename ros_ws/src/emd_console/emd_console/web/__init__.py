"""What is served to browsers: pages, the live stream, and who may see and do what."""
