"""The nonlinear plant of equation (1), its operating points, and the linear families of equation
(2)."""
