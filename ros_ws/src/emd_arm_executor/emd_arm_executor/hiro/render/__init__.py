"""A z-buffer renderer for the cell: colour, metric depth and segmentation."""
