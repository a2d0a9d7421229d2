"""Progress and notes of long jobs: bars in a terminal or a notebook, lines elsewhere."""
