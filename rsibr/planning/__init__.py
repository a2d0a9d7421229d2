"""Which effects a scene calls for: evidence, thresholds, costs, the plan."""
