"""Radiance sphere maps by direct lighting, and their store on disk."""
