"""What depends on the light alone: its picture, its blurred levels, probes of it."""
