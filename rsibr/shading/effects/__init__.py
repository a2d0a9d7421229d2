"""Effects of being an object, one a file: what a picture simulates beyond the maps, with evidence from the scene."""
