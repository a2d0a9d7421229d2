"""Gallery of a batch: a contact sheet of all its bakes in one HTML page."""
