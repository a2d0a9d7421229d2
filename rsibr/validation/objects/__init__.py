"""Truth for pictures of objects, and their errors by zone and by cause."""
