"""Tables of the methods that a page draws: each system's in a file of its own, found by import."""
