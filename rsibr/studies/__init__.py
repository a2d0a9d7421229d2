"""Accuracy against time: parameter sweeps, convergence, Pareto fronts, and the gain of twice the time."""
