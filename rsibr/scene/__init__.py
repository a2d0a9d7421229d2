"""Scene description: config, environment and material, validated before they reach Mitsuba."""
