"""What a scene calls for: the lobes that a material is made of."""
