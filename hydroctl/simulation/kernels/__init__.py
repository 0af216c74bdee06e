"""What numba compiles of a simulation."""
