"""Accuracy against time: sweeps over what a bake can spend on, their fronts, and what twice the time buys."""
