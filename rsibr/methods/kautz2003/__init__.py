"""Method of Kautz, Daubert, Seidel (2003): nine harmonic coefficients for diffuse, a filtered cube for glossy."""
