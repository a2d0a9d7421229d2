"""Forecast of a batch: jobs by kind, probes, rates, and what follows from them."""
