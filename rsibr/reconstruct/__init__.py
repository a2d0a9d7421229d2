"""Any view's radiance from the stored ones: warps, blends and the methods made of them."""
