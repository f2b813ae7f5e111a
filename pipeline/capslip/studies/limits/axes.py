"""All axes along which the method is driven until it breaks: one row an axis.

A row is its name, the quantity of its severity, the severities from harmless to hopeless, what is
tried at each, and the warnings that name the cause.
"""

from itertools import product

from capslip.studies.limits import changes
from capslip.studies.limits.case import Axis
from capslip.studies.limits.tries import (
    at_loads,
    caps_at_edge,
    equal_caps,
    few_caps,
    hidden_family,
    many_points,
    off_balance,
    on_faces,
    paired_caps,
    pixel_ratio,
    points_along,
    rough,
    scattered_face,
    self_affine,
    spikes,
    two_families,
    uneven_counts,
    wavy,
    with_change,
    with_scene,
)

# Kept as a table by hand: one paragraph an axis
# fmt: off
LOW_LOADS_N, LOADS_N = (20.0, 100.0, 460.0), (50.0, 460.0, 2000.0)
LIGHT_LOADS_N, WAVE_LOADS_N = (46.0, 460.0, 2000.0), (100.0, 460.0, 2000.0)
COUNTS = ((5, 18), (12, 11), (18, 5), (20, 3), (3, 8), (2, 21), (2, 4), (5, 2), (22, 1), (1, 22),
          (5, 1), (1, 5), (1, 1), (23, 0))
FACTORS = (25.4, 1 / 25.4, 1e3, 1e-3, 1e6, 1e-6)
RATIOS = (1.2, 2.0, 1 / 2.0, 4.0, 1 / 4.0, 8.0, 1 / 8.0, 16.0, 1 / 16.0, 64.0)

BUMPY = ("shallow_saddles", "not_spherical", "pruning_decides", "boundary_elements_needed",
         "detail_decides")
MERGED = ("connected_network", "shallow_saddles", "contacts_merge", "pruning_decides",
          "not_spherical")
CRUSHED = ("face_closes", "bulk_dominates", "contacts_merge", "contact_beyond_cap",
           "contact_failed", "bulk_kept", "boundary_elements_needed", "contact_reaches_below_cut",
           "pressure_beyond_elastic", "cut_too_high")
WAVY = ("boundary_elements_needed", "not_spherical", "connected_network", "shallow_saddles",
        "caps_edge", "not_balanced", "detail_decides")
FORM = ("tilt_left", "bow_left", "one_contact", "caps_edge", "connected_network", "tips_over",
        "not_balanced", "slope_suspect")
FEW_POINTS = ("contact_under_resolved", "hills_too_small", "no_caps", "caps_apex_off_surface",
              "detail_decides", "small_slip_extrapolated")
CUT = ("family_below_cut", "plateau_at_cut", "no_caps",
       "contact_reaches_below_cut", "cut_too_high")
UNITS = ("slope_suspect", "face_closes", "scale_suspect", "pressure_beyond_elastic",
         "contact_beyond_cap", "contact_reaches_below_cut", "contact_under_resolved",
         "contacts_merge", "one_contact", "contact_failed", "cut_too_high")
SPIKES = ("outliers", "outliers_removed", "spikes", "highest_point_on_no_cap", "caps_outlier",
          "detail_decides")
DUST = (*SPIKES, "one_contact", "not_spherical", "load_on_doubtful_caps", "caps_plateau")
LEVEL = ("levelling_decides", "tips_over", "not_balanced", "level_not_settled", "slope_suspect")

AXES = (
    Axis("small force", "T / (mu N)", (0.1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10),
         on_faces("T = {:g} mu N", lambda x: {"shares": (x,)}), ()),
    Axis("small height difference", "h [m]", (1.6e-7, 1e-7, 5e-8, 2e-8, 1e-8, 5e-9, 2e-9),
         at_loads("h = {nm:g} nm, {load:g} N", two_families, LOADS_N, (4,)),
         ("families_doubtful", "contacts_merge")),
    Axis("hidden family", "h [m]", (2.4e-7, 3e-7, 3.4e-7, 3.7e-7, 4e-7, 4.3e-7),
         at_loads("h = {nm:g} nm, {load:g} N", hidden_family, LOADS_N, (4,)),
         ("family_below_cut", "contact_reaches_below_cut", "cut_too_high")),
    Axis("uneven families", "smaller of m and n", COUNTS, uneven_counts,
         ("families_doubtful", "one_contact"), logarithmic=False),
    Axis("few caps", "caps", (6.0, 4.0, 3.0, 2.0, 1.0),
         at_loads("{x:g} caps, {load:g} N", few_caps, LOW_LOADS_N, (7,)),
         ("one_contact", "families_doubtful"), logarithmic=False),
    Axis("identical caps", "noise [m]", (0.0, 0.3e-9, 1e-9, 3e-9), equal_caps,
         ("families_doubtful", "contacts_merge")),
    Axis("spread of heights", "spread of each family, 0.1 um apart [m]",
         (2e-9, 1e-8, 1.4e-8, 1.8e-8, 2.2e-8),
         at_loads("spread {nm:g} nm, seed {face}", scattered_face, (460.0,), (2, 3, 4, 5)),
         ("families_doubtful", "more_than_two_families")),
    Axis("roughness", "rms [m], correlation length 1 mm",
         (0.5e-9, 1e-9, 2e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7),
         with_scene("roughness {:g} m", rough), BUMPY),
    Axis("hills that merge", "distance [disc radii]",
         (2.2, 1.8, 1.4, 1.0, 0.7, 0.4, 0.2, 0.1),
         at_loads("{x:g} disc radii apart, {load:g} N", paired_caps, LIGHT_LOADS_N, (0,)),
         MERGED),
    Axis("hills cut by the edge", "apex inside [disc radii]",
         (1.1, 0.8, 0.5, 0.3, 0.1, 0.0, -0.1, -0.3),
         at_loads("apex {x:g} disc radii inside, {load:g} N", caps_at_edge, LIGHT_LOADS_N, (0,)),
         ("caps_edge", "load_on_doubtful_caps", "contact_beyond_cap"), logarithmic=False),
    Axis("grinding lay", "rms of grooves 2 mm apart [m]",
         (0.5e-9, 2e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 3e-7),
         with_change("face_change", "lay of {:g} m", changes.with_lay),
         ("caps_ridge", *BUMPY)),
    Axis("elongated caps", "ratio of principal radii",
         (1.2, 1.5, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0),
         with_change("face_change", "R1 / R2 = {:g}", changes.elongated),
         ("not_spherical", "caps_ridge", "caps_edge", "shallow_saddles", "connected_network")),
    Axis("high load", "preload [N]", (1e3, 3e3, 1e4, 3e4, 1e5, 3e5, 1e6),
         on_faces("{:g} N", lambda x: {"preload_N": x}), CRUSHED),
    Axis("low load", "preload [N]", (100.0, 10.0, 1.0, 0.1, 1e-3, 1e-6),
         on_faces("{:g} N", lambda x: {"preload_N": x}),
         ("one_contact", "contact_under_resolved")),
    Axis("gross slip", "T / (mu N)", (0.8, 0.9, 0.99, 0.999, 1.001, 1.1, 2.0),
         on_faces("T = {:g} mu N", lambda x: {"shares": (x,)}), (), logarithmic=False),
    Axis("wavy faces", "correlation length [m]", (12e-3, 8e-3, 5e-3, 3e-3, 2e-3, 1e-3),
         at_loads("waves of {mm:g} mm, {load:g} N, seed {face}", wavy, WAVE_LOADS_N, (50, 51)),
         WAVY),
    Axis("self-affine faces", "Hurst exponent", (2.0, 1.4, 1.0, 0.8, 0.5),
         at_loads("Hurst exponent {x:g}, {load:g} N, seed {face}", self_affine,
                  WAVE_LOADS_N, (60, 61)), WAVY, logarithmic=False),
    Axis("noise", "rms [m]", (0.5e-9, 2e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 2e-7),
         with_scene("noise {:g} m", lambda x: {"noise_rms_m": x}),
         ("caps_noisy_apex", "load_on_doubtful_caps", "detail_decides")),
    Axis("tilt left in", "slope", (1e-8, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1.0),
         with_scene("slope {:g}", lambda x: {"tilt": (x, -0.5 * x)}, "conditioning.form=none"),
         FORM),
    Axis("bow left in", "rise over the middle [m]",
         (1e-9, 1e-8, 3e-8, 1e-7, 2e-7, 5e-7, 1e-6, 1e-5),
         with_scene("bow {:g} m", lambda x: {"bow_m": (0.5 * x, x)}), FORM, misread=True),
    Axis("cylinder left in", "radius [m]", (1e6, 1e5, 1e4, 3e3, 1e3, 100.0, 1.0),
         with_scene("cylinder {:g} m", lambda x: {"cylinder_radius_m": x}), FORM, misread=True),
    Axis("non-measured patches", "radius of 12 patches [m]",
         (2e-4, 5e-4, 1e-3, 2e-3, 3e-3, 5e-3, 8e-3),
         with_scene("patches of {:g} m", lambda x: {"n_patches": 12, "patch_radius_m": x}),
         ("hole_may_hide_hills", "tops_in_holes", "caps_non_measured", "load_on_doubtful_caps",
          "contact_at_hole")),
    Axis("scattered missing points", "share",
         (0.01, 0.05, 0.2, 0.5, 0.8, 0.9, 0.95, 0.98, 0.995),
         with_scene("{:.1%} missing", lambda x: {"non_measured_fraction": x}),
         ("caps_non_measured", "load_on_doubtful_caps", "no_caps", "detail_decides",
          "points_filled", "hole_may_hide_hills")),
    Axis("clipped sensor", "share of the highest cap",
         (0.001, 0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 0.95),
         with_change("scan_change", "highest {:.1%} clipped", changes.clipped),
         ("caps_plateau", "clipped")),
    Axis("quantised heights", "step [m]", (0.1e-9, 1e-9, 5e-9, 1e-8, 2e-8, 5e-8, 1e-7, 3e-7),
         with_change("scan_change", "steps of {:g} m", changes.quantised),
         ("caps_plateau", "plateau_at_cut", "detail_decides", "heights_in_steps")),
    Axis("few pixels", "points along the longer side",
         (1200.0, 300.0, 150.0, 75.0, 45.0, 30.0, 24.0, 18.0, 12.0),
         with_scene("{:g} points along the face", points_along), FEW_POINTS),
    Axis("many pixels", "points along the longer side",
         ((600, "smaller caps"), (2400, "caps of some spread"), (4800, "caps of the paper")),
         many_points, ()),
    Axis("low share kept", "material ratio", (0.08, 0.06, 0.04, 0.02, 0.01, 0.005, 0.002),
         on_faces("cut at {:.1%}", lambda x: {"overrides": (f"hills.material_ratio={x!r}",)}),
         CUT),
    Axis("high share kept", "material ratio", (0.12, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6),
         on_faces("cut at {:.1%}", lambda x: {"overrides": (f"hills.material_ratio={x!r}",)}),
         CUT),
    Axis("non-square pixels", "dy / dx", RATIOS, with_scene("dy / dx = {:.3g}", pixel_ratio),
         ("non_square_pixels", *FEW_POINTS)),
    Axis("heights in a wrong unit", "factor", (*FACTORS, 1e9),
         with_change("scan_change", "times {:.3g}", changes.heights_misread), UNITS, misread=True),
    Axis("pixels in a wrong unit", "factor", FACTORS,
         with_change("scan_change", "times {:.3g}", changes.pixels_misread), UNITS, misread=True),
    Axis("heights and pixels in a wrong unit", "factor", FACTORS,
         with_change("scan_change", "times {:.3g}", changes.both_misread), UNITS, misread=True),
    Axis("spikes", "number times height [m]",
         tuple(product((1, 20, 600, 3000), (0.1e-6, 1e-6, 1e-4))), spikes,
         (*SPIKES, "caps_apex_off_surface")),
    Axis("dust", "width of three grains [pixels]", (1.0, 2.0, 3.0, 4.0, 6.0, 10.0),
         with_change("scan_change", "grains of {:g} pixels", changes.dusty), DUST),
    Axis("levelling", "tilt of the least-squares plane [m]",
         (None, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3), off_balance, LEVEL),
)
# fmt: on


def axes(seed: int = 0) -> tuple[Axis, ...]:
    """Return all axes.

    Parameters
    ----------
    seed : int
        Another one gives other faces, and other noise, of the same kinds.

    Examples
    --------
    >>> found = axes()
    >>> len(found) >= 16, sum(len(axis.cases) for axis in found) >= 400
    (True, True)
    """
    return tuple(axis.on_faces_of(seed) for axis in AXES)
