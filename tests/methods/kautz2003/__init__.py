"""Tests of the method of Kautz, Daubert, Seidel (2003)."""
