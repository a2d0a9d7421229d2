"""Lobes of a material: basis, fit, exact split, directional albedo, mixtures of Gaussians over slopes."""
