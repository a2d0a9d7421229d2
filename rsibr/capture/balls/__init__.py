"""Balls: what a mirror ball or a matte ball in a photograph says of the light around it."""
