"""What an object hides of the sky from itself: the matte part by vertex, dielectric gloss by one mirror ray."""
