"""Renders radiance sphere maps by direct lighting: integrator, samples, views."""
