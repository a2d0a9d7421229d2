"""Objects and where they come from: Mitsuba scenes and mesh files, repaired, and lit for path tracing."""
