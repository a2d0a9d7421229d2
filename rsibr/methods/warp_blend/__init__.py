"""Methods that warp stored maps to the new view and blend them, after Cabral, Olano, Nemec (1999)."""
