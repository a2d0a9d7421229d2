"""Car paint as layers of pigments, flakes and clear coat, down to a Mitsuba BSDF."""
