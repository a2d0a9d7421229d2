"""What a material reflects, lobe by lobe: fit, exact split, directional albedo, Gaussians over slopes."""
