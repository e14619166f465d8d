"""Files that a trajectory file names, and SPICE kernels."""
