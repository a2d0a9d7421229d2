"""Pictures, their files, and sequences of them."""
