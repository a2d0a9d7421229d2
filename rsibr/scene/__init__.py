"""What is rendered: the config, the environment and the material, read and checked before Mitsuba sees them."""
