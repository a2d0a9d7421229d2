"""Split-sum shading of real-time engines: prefiltered environments and a two-channel albedo table."""
