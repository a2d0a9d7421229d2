"""Method `rsibr`: prediction of all lobes from the environment, plus warped residuals of the stored maps."""
