"""Our method: a model of all lobes made from the light, and the residuals of the stored maps."""
