"""GGX lobes by brute force in float64: what the model of a lobe has to come near, without the code under test."""

import numpy as np

IOR = 1.5


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def schlick(cosine):
    return (1 - np.clip(cosine, 0, 1)) ** 5


def shadowing(cos_i, cos_o, alpha):
    """Height-correlated masking and shadowing by the Λ of Heitz (2014), eq. 72 and 99."""

    def hidden(cosine):
        tangent = np.sqrt(np.maximum(1 - cosine**2, 0)) / cosine
        return (np.sqrt(1 + (alpha * tangent) ** 2) - 1) / 2

    return 1 / (1 + hidden(cos_i) + hidden(cos_o))


def ggx(wi, wo, alpha):
    """BRDF times cosine, F = 1; Walter et al. (2007), eq. 20 and 33."""
    h = unit(wi + wo)
    cos_i, cos_o = np.maximum(wi[..., 2], 1e-9), np.maximum(wo[..., 2], 1e-9)
    distribution = alpha**2 / (np.pi * (h[..., 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    return np.where(wi[..., 2] > 0, distribution * shadowing(cos_i, cos_o, alpha) / (4 * cos_o), 0)


def dielectric(wi, wo, alpha):
    """GGX with Schlick's Fresnel term of a reflectance of 0.04."""
    toward = (unit(wi + wo) * wo).sum(axis=-1)
    return ggx(wi, wo, alpha) * (0.04 + 0.96 * schlick(toward))


def slope_lobe(wi, wo, density, alpha):
    """BRDF times cosine, F = 1, of a density of slopes, |slope|² → (n,), with the masking of roughness `alpha`."""
    h = unit(wi + wo)
    cos_h = np.maximum(h[..., 2], 1e-9)
    distribution = density((1 - cos_h**2) / cos_h**2) / cos_h**4
    return distribution * shadowing(wi[..., 2], wo[..., 2], alpha) / (4 * wo[..., 2])


def beckmann(wi, wo, alpha, masking=None):
    """Beckmann's lobe, by default with GGX' masking of the same roughness."""
    density = lambda squared: np.exp(-squared / alpha**2) / (np.pi * alpha**2)  # noqa: E731
    return slope_lobe(wi, wo, density, alpha if masking is None else masking)


def into_coat(w):
    lateral = w[..., :2] / IOR
    return np.concatenate([lateral, np.sqrt(1 - (lateral**2).sum(-1, keepdims=True))], axis=-1)


def under_coat(brdf, wi, wo):
    """A lobe below a smooth coat: T T f'/η² times the outer cosine."""
    inner_i, inner_o = into_coat(wi), into_coat(wo)
    below = brdf(inner_i, inner_o) / inner_i[..., 2]
    return below * np.maximum(wi[..., 2], 0) / IOR**2 * (1 - schlick(wi[..., 2])) * (1 - schlick(wo[..., 2]))


def coated_ggx(wi, wo, alpha):
    return under_coat(lambda inner_i, inner_o: ggx(inner_i, inner_o, alpha), wi, wo)


def hemisphere(rows, columns):
    """Directions (M, 3) and solid angles (M,) of a grid over the upper hemisphere, even in solid angle."""
    z = (np.arange(rows) + 0.5) / rows
    turn = (np.arange(columns) + 0.5) * 2 * np.pi / columns
    r = np.sqrt(1 - z**2)[:, None]
    grid = np.stack([r * np.cos(turn), r * np.sin(turn), np.broadcast_to(z[:, None], (rows, columns))], axis=-1)
    return grid.reshape(-1, 3), np.full(rows * columns, 2 * np.pi / (rows * columns))


def facets(alpha, radii=200, turns=128):
    """Normals of GGX facets (M, 3) that each stand for the same projected area."""
    u = (np.arange(radii) + 0.5)[:, None] / radii
    turn = (np.arange(turns) + 0.5) * 2 * np.pi / turns
    slope = alpha * np.sqrt(u / (1 - u))
    flat = np.stack([slope * np.cos(turn), slope * np.sin(turn), np.ones((radii, turns))], axis=-1)
    return unit(flat).reshape(-1, 3)


def local_frames(n, v):
    """Columns x (toward the viewer), y, n of surfaces (K, 3) seen from `v` (K, 3): (K, 3, 3)."""
    x = unit(v - n * (n * v).sum(-1, keepdims=True))
    return np.stack([x, np.cross(n, x), n], axis=-1)


def viewer(cosine):
    """The viewer in the surface's frame."""
    return np.array([np.sqrt(1 - cosine**2), 0.0, cosine])


def metal(sky, n, v, alpha, fresnel=np.ones_like):
    """Radiance (K, 3) of a GGX metal under `sky`, (..., 3) → (..., 3), and its directional albedo (K,)."""
    h = facets(alpha)
    radiance, albedo = [], []
    for frame, cosine in zip(local_frames(n, v), (n * v).sum(-1), strict=True):
        wo = viewer(cosine)
        toward = h @ wo
        wi = 2 * toward[:, None] * h - wo
        seen = (toward > 0) & (wi[:, 2] > 0)
        weight = np.zeros(len(h))
        masked = shadowing(wi[seen, 2], cosine, alpha)
        weight[seen] = fresnel(toward[seen]) * masked * toward[seen] / (cosine * h[seen, 2])
        radiance.append(weight @ sky(wi @ frame.T) / len(h))
        albedo.append(weight.mean())
    return np.array(radiance), np.array(albedo)


def by_quadrature(sky, n, v, brdf, rows=300, columns=600):
    """The same of any BRDF times cosine, (wi, wo) → (M,), over all directions of the light."""
    wi, angle = hemisphere(rows, columns)
    radiance, albedo = [], []
    for frame, cosine in zip(local_frames(n, v), (n * v).sum(-1), strict=True):
        weight = brdf(wi, np.broadcast_to(viewer(cosine), wi.shape)) * angle
        radiance.append(weight @ sky(wi @ frame.T))
        albedo.append(weight.sum())
    return np.array(radiance), np.array(albedo)


def soft_sky(d):
    """A bright sun of 12° over a coloured gradient: smooth, and alike from no two sides."""
    x, y, _ = np.moveaxis(d, -1, 0)
    sun = np.exp(25 * (d @ unit(np.array([0.5, 0.7, 0.4])) - 1))
    return np.stack([0.6 + 0.3 * y + 8 * sun, 0.6 + 0.3 * x + 6 * sun, 0.8 + 0.4 * y + 4 * sun], axis=-1)


def pairs(rng, count, least=0.15):
    """Normals and views (count, 3) at cosines from `least` to nearly 1, spread evenly."""
    n = unit(rng.normal(size=(count, 3)))
    across = unit(np.cross(n, rng.normal(size=(count, 3))))
    cosine = np.linspace(least, 0.995, count)[:, None]
    return n, n * cosine + across * np.sqrt(1 - cosine**2)
