"""What a notebook shows of bakes, maps and results: cards and plots."""
