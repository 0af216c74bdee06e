"""The project's own equations, compiled with numba as they stand."""
