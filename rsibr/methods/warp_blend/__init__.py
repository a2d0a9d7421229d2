"""Cabral, Olano, Nemec (1999): stored maps warped to the new view and blended."""
