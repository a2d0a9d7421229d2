"""Car paint: layers of pigment, flakes and clear coat, as a Mitsuba BSDF."""
