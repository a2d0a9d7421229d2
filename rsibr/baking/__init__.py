"""Rendering of radiance sphere maps by direct illumination: integrator, sampling, views."""
