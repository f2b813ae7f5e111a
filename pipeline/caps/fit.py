"""Spherical caps fitted to hills, all hills at once."""

import numpy as np

from pipeline.caps.hills import MIN_POINTS, Hills
from pipeline.caps.table import CapFlag, CapTable
from pipeline.surface.heightmap import HeightMap

NOISY_APEX_RATIO = 0.1


def equation18_radius_m(diameter_m: np.ndarray, cap_height_m: np.ndarray) -> np.ndarray:
    """Radius of a spherical cap from its base and height: R = (D^2/4 + df^2) / (2 df).

    Parameters
    ----------
    diameter_m, cap_height_m : array_like, any equal shape
        D and df, both positive.

    Notes
    -----
    Equation 18 of Peyret, Chevallier and Dion 2016. Written as a sum of two quotients it loses no
    digit where df << D.

    Examples
    --------
    >>> round(float(equation18_radius_m(18e-3, 1.7e-6)), 2)
    23.82
    """
    diameter_m, cap_height_m = np.asarray(diameter_m), np.asarray(cap_height_m)
    return diameter_m**2 / (8.0 * cap_height_m) + cap_height_m / 2.0


def fit_caps(surface: HeightMap, hills: Hills, fit: str = "pinned") -> CapTable:
    """Fit one sphere to each hill.

    Parameters
    ----------
    surface : HeightMap
        Heights after removal of the form.
    hills : Hills
        Labelled hills of the same map.
    fit : {"equation18", "pinned"}
        `equation18` is the paper's rule: df is the hill's highest point above the cut, D the
        diameter of the circle that has the area of the hill. `pinned` takes the apex from a
        paraboloid through the upper half of the hill, which noise does not lift; where that
        paraboloid does not peak inside the hill it falls back to the highest point, with a flag.

    Returns
    -------
    CapTable
        One row a hill. Loads and contact radii are NaN, families empty.
    """
    n = hills.n_hills
    rows, cols = np.nonzero(hills.label)
    label = hills.label[rows, cols] - 1
    z_m = surface.height_m[rows, cols]
    dy_m, dx_m = surface.pixel_size_m
    x_m, y_m = (cols + 0.5) * dx_m, (rows + 0.5) * dy_m

    area_m2 = np.bincount(label, minlength=n) * surface.pixel_area_m2
    area_m2 += _enclosed_holes(surface, hills.label, n) * surface.pixel_area_m2
    order = np.lexsort((-z_m, label))
    highest = order[np.searchsorted(label[order], np.arange(n))]
    apex_x_m, apex_y_m, apex_z_m = x_m[highest], y_m[highest], z_m[highest]
    flags = _edge_flags(surface, hills.label, n)
    ties = np.bincount(label[z_m == apex_z_m[label]], minlength=n)
    flags[ties > 1] |= CapFlag.plateau.value

    if fit == "pinned":
        upper = z_m >= (hills.cut_height_m + 0.5 * (apex_z_m - hills.cut_height_m))[label]
        vertex = _paraboloid_vertex(
            label[upper], x_m[upper], y_m[upper], z_m[upper], apex_x_m, apex_y_m, apex_z_m
        )
        on_hill = _on_hill(surface, hills.label, *vertex, hills.cut_height_m)
        apex_x_m, apex_y_m, apex_z_m = (
            np.where(on_hill, fitted, measured)
            for fitted, measured in zip(vertex, (apex_x_m, apex_y_m, apex_z_m), strict=True)
        )
        flags[~on_hill] |= CapFlag.apex_off_surface.value

    cap_height_m = apex_z_m - hills.cut_height_m
    diameter_m = 2.0 * np.sqrt(area_m2 / np.pi)
    radius_m = np.full(n, np.nan)
    has_height = cap_height_m > 0.0
    radius_m[has_height] = equation18_radius_m(diameter_m[has_height], cap_height_m[has_height])
    flags[~has_height] |= CapFlag.not_convex.value
    flags[hills.noise_m > NOISY_APEX_RATIO * cap_height_m] |= CapFlag.noisy_apex.value

    distance2_m2 = (x_m - apex_x_m[label]) ** 2 + (y_m - apex_y_m[label]) ** 2
    sphere_m = apex_z_m[label] - distance2_m2 / (2.0 * radius_m[label])
    n_points = np.maximum(np.bincount(label, minlength=n), 1)
    residual_m = np.sqrt(np.bincount(label, (z_m - sphere_m) ** 2, minlength=n) / n_points)
    return CapTable(
        x_m=apex_x_m,
        y_m=apex_y_m,
        peak_height_m=apex_z_m,
        cap_height_m=cap_height_m,
        diameter_m=diameter_m,
        radius_m=radius_m,
        area_m2=area_m2,
        residual_m=residual_m,
        family=np.full(n, "", dtype="<U1"),
        load_N=np.full(n, np.nan),
        contact_radius_m=np.full(n, np.nan),
        flags=flags,
    )


def _paraboloid_vertex(
    label: np.ndarray,
    x_m: np.ndarray,
    y_m: np.ndarray,
    z_m: np.ndarray,
    x0_m: np.ndarray,
    y0_m: np.ndarray,
    z0_m: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertex of z = a + b x + c y - d (x^2 + y^2) by least squares, for all labels at once.

    NaN where there is none (too few points, or no downward curvature). Coordinates count from each
    hill's highest point and are scaled by its extent, so that the normal equations stay well
    conditioned.
    """
    n = len(x0_m)
    x_m, y_m, z_m = x_m - x0_m[label], y_m - y0_m[label], z_m - z0_m[label]
    extent_m = np.zeros(n)
    np.maximum.at(extent_m, label, np.hypot(x_m, y_m))
    extent_m[extent_m == 0.0] = 1.0
    u, v = x_m / extent_m[label], y_m / extent_m[label]
    basis = (np.ones_like(u), u, v, -(u**2 + v**2))
    normal = np.empty((n, 4, 4))
    right = np.empty((n, 4))
    for i, first in enumerate(basis):
        right[:, i] = np.bincount(label, first * z_m, minlength=n)
        for j, second in enumerate(basis[: i + 1]):
            normal[:, i, j] = normal[:, j, i] = np.bincount(label, first * second, minlength=n)
    points = normal[:, 0, 0]
    solvable = (points >= 6) & (np.linalg.cond(normal) < 1e8)
    a, b, c, d = np.full((4, n), np.nan)
    if solvable.any():
        solution = np.linalg.solve(normal[solvable], right[solvable][:, :, None])[:, :, 0]
        a[solvable], b[solvable], c[solvable], d[solvable] = solution.T
    d[~(d > 0.0)] = np.nan
    x = x0_m + extent_m * b / (2 * d)
    y = y0_m + extent_m * c / (2 * d)
    return x, y, z0_m + a + (b**2 + c**2) / (4 * d)


def _on_hill(
    surface: HeightMap,
    label: np.ndarray,
    x_m: np.ndarray,
    y_m: np.ndarray,
    z_m: np.ndarray,
    cut_height_m: float,
) -> np.ndarray:
    """Tell whether each fitted apex is finite, above the cut and over its own hill."""
    (ny, nx), (dy_m, dx_m) = surface.shape, surface.pixel_size_m
    finite = np.isfinite(x_m) & np.isfinite(y_m) & np.isfinite(z_m)
    row = np.clip(np.floor(np.where(finite, y_m, 0.0) / dy_m), -1, ny).astype(int)
    col = np.clip(np.floor(np.where(finite, x_m, 0.0) / dx_m), -1, nx).astype(int)
    inside = finite & (row >= 0) & (row < ny) & (col >= 0) & (col < nx)
    here = np.where(inside, label[row * inside, col * inside], 0)
    hole = inside & ~surface.measured[row * inside, col * inside]
    return ((here == np.arange(1, len(x_m) + 1)) | hole) & inside & (z_m > cut_height_m)


def _edge_flags(surface: HeightMap, label: np.ndarray, n: int) -> np.ndarray:
    from scipy import ndimage

    flags = np.zeros(n + 1, dtype=np.uint16)
    border = np.concatenate((label[0], label[-1], label[:, 0], label[:, -1]))
    flags[np.unique(border)] |= CapFlag.edge.value
    # Single points that the instrument lost do no harm; patches cut a hill.
    patch, _ = ndimage.label(~surface.measured, structure=np.ones((3, 3)))
    cuts = np.bincount(patch.ravel()) >= MIN_POINTS
    cuts[0] = False
    if cuts.any():
        beside = ndimage.binary_dilation(cuts[patch], structure=np.ones((3, 3)))
        flags[np.unique(label[beside])] |= CapFlag.non_measured.value
    return flags[1:]


def _enclosed_holes(surface: HeightMap, label: np.ndarray, n: int) -> np.ndarray:
    """Non-measured points whose neighbours mostly belong to one hill, counted by hill.

    Without them the equal-area diameter shrinks with every point that the instrument lost.
    """
    from scipy import ndimage

    rows, cols = np.nonzero(~surface.measured)
    if rows.size == 0:
        return np.zeros(n)
    around = ndimage.maximum_filter(label, size=3, mode="constant")[rows, cols]
    share = ndimage.uniform_filter((label > 0).astype(float), size=3, mode="constant")
    measured = ndimage.uniform_filter(surface.measured.astype(float), size=3, mode="constant")
    inside = (share[rows, cols] > 0.5 * measured[rows, cols]) & (around > 0)
    return np.bincount(around[inside] - 1, minlength=n).astype(float)
