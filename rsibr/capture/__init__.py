"""Capture: photographs, exposure brackets, mirror balls and renders of a scene become environments and maps."""
