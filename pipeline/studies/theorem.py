"""How far the theorem of the slip law is from a direct solution with Cerruti's kernel.

`python -m pipeline.studies.theorem` prints the table of docs/theory.md, in about two minutes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.contact.material import composite
from pipeline.contact.polonsky_keer import elastic_face, press, stiffness_of_regions_N_per_m
from pipeline.contact.tangential import shear
from pipeline.studies.scenes import cases, make_face
from pipeline.surface.heightmap import HeightMap

POISSON_RATIOS = (0.3, 0.45)
FORCE_SHARES = (0.1, 0.25, 0.5, 0.75)  # T / (mu N)
DIRECTIONS = {"x": 1.0 + 0j, "y": 1j}  # of the force
E_STAR_PA = 109.89e9  # for all Poisson's ratios, so that the pressures are the same
FRICTION = 0.2  # scales forces and displacements, but no ratio of them
TOLERANCE = 1e-9
NO_SLIP = 0.01  # T / (mu N) that a uniform pressure holds everywhere


@dataclass(frozen=True)
class TheoremError:
    """The theorem over the direct solution, less one."""

    face: str
    group: str
    poisson_ratio: float
    direction: str
    stiffness: float  # before any slip
    displacement: tuple[float, ...]  # at the shares of force
    energy: tuple[float, ...]  # of a cycle, at given force


def theorem_errors(
    surface: HeightMap, preload_N: float, name: str = "", group: str = ""
) -> Iterator[TheoremError]:
    """Compare both on the same grid, so that what the pixels cost drops out.

    Parameters
    ----------
    surface : HeightMap
        The face, conditioned.
    preload_N : float
        Normal load.
    name, group : str
        Of the face, for the table.
    """
    face, held_N = elastic_face(surface, E_STAR_PA), FRICTION * preload_N
    loaded = press(face, load_N=preload_N, tolerance=TOLERANCE)
    punch_N_per_m = float(stiffness_of_regions_N_per_m(face, loaded).sum())
    touches = loaded.pressure_Pa > 0
    punch = replace(loaded, pressure_Pa=touches * loaded.pressure_Pa[touches].mean())
    withdrawn_m, loss_J = [], []
    for share in FORCE_SHARES:
        rest = 1 - share
        start_Pa = rest * loaded.pressure_Pa
        lower = press(face, load_N=rest * preload_N, tolerance=TOLERANCE, start_Pa=start_Pa)
        withdrawn_m.append(loaded.approach_m - lower.approach_m)
        gap_m = np.where(lower.pressure_Pa > 0, 0.0, np.maximum(lower.gap_m, 0.0))
        loss_J.append(4 * float((loaded.pressure_Pa * gap_m).sum()) * face.pixel_area_m2)
    for nu in POISSON_RATIOS:
        joint = composite((2 * (1 - nu**2) * E_STAR_PA,) * 2, (nu, nu))
        delta_m = FRICTION * joint.kappa * np.array(withdrawn_m)
        W_J = FRICTION**2 * joint.kappa * np.array(loss_J)
        for direction, along in DIRECTIONS.items():
            force_N = NO_SLIP * held_N * along
            stuck = shear(punch, joint, FRICTION, force_N, tolerance=TOLERANCE)
            compliance_m_per_N = (stuck.displacement_m / force_N).real
            slid = [
                shear(loaded, joint, FRICTION, share * held_N * along, tolerance=TOLERANCE)
                for share in FORCE_SHARES
            ]
            direct_m = np.array([(one.displacement_m / along).real for one in slid])
            direct_J = np.array([4 * one.work_J for one in slid])
            yield TheoremError(
                name,
                group,
                nu,
                direction,
                punch_N_per_m / joint.kappa * compliance_m_per_N - 1,
                tuple((delta_m / direct_m - 1).tolist()),
                tuple((W_J / direct_J - 1).tolist()),
            )


def paraboloid(ratio: float, n_pixels: int = 96) -> HeightMap:
    """Return a paraboloid whose principal radius along x is `ratio` times that along y."""
    pixel_m = 6.4e-3 / n_pixels
    x = (np.arange(n_pixels) - n_pixels / 2 + 0.5) * pixel_m
    radius_y_m = 20.0 / np.sqrt(ratio)
    depth_m = x**2 / (2 * ratio * radius_y_m) + x[:, None] ** 2 / (2 * radius_y_m)
    return HeightMap(-depth_m, (pixel_m, pixel_m))


def main() -> str:
    """Measure all faces and return the table, in per cent."""
    found = [
        *theorem_errors(paraboloid(1.0), 20.0, "sphere", "sphere"),
        *theorem_errors(paraboloid(3.0), 20.0, "paraboloid, radii 3:1", "paraboloid"),
    ]
    for case in cases():
        if case.group in ("caps", "waves"):
            measured = make_face(case).measured
            found += theorem_errors(measured, case.preload_N, case.name, case.group)
    shares = " ".join(f"{share:13g}" for share in FORCE_SHARES)
    lines = [f"{'face':32s}   nu     stiffness {shares}   (displacement/energy, %)"]
    for row in found:
        pairs = zip(row.displacement, row.energy, strict=True)
        numbers = " ".join(f"{100 * d:+6.2f}/{100 * W:+6.2f}" for d, W in pairs)
        name = f"{row.face}, {row.direction}"
        lines.append(f"{name:32s} {row.poisson_ratio:4g} {100 * row.stiffness:+13.2f} {numbers}")
    for group in ("caps", "waves"):
        for nu in POISSON_RATIOS:
            rows = [row for row in found if (row.group, row.poisson_ratio) == (group, nu)]
            columns = np.abs(
                [
                    (row.stiffness, *(n for p in zip(row.displacement, row.energy) for n in p))
                    for row in rows
                ]
            )
            for name, many in (("median", np.median), ("worst", np.max)):
                sizes = 100 * many(columns, axis=0)
                pairs = zip(sizes[1::2], sizes[2::2], strict=True)
                numbers = " ".join(f"{d:6.2f}/{W:6.2f}" for d, W in pairs)
                lines.append(f"{f'{group}, {name} size':32s} {nu:4g} {sizes[0]:13.2f} {numbers}")
    return "\n".join(lines)


if __name__ == "__main__":
    print(main())
