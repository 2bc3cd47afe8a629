"""The cell as a whole: launcher, folding loop, bags, command line."""
