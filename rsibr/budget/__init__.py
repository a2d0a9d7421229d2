"""Chooses resolution, views and samples so that a promised error or time is kept, and says what was reached."""
