"""How far the theorem of the slip law is from a direct solution with Cerruti's kernel.

`python -m capslip.studies.theorem.errors` prints the table of docs/theory.md, in two minutes.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from capslip.contact.lay import Lay, energies_of_map
from capslip.contact.material import composite
from capslip.contact.solvers.polonsky_keer import elastic_face, press, punch_pressure_Pa_per_m
from capslip.studies.faces.scenes import cases, make_face
from capslip.studies.theorem.tangential import shear
from capslip.surface.heightmap import HeightMap

POISSON_RATIOS = (0.3, 0.45)
FORCE_SHARES = (0.1, 0.25, 0.5, 0.75)  # T / (mu N)
DIRECTIONS = {"x": 1.0 + 0j, "y": 1j}  # of the force
E_STAR_PA = 109.89e9  # for all Poisson's ratios, so that the pressures are the same
FRICTION = 0.2  # scales forces and displacements, but no ratio of them
TOLERANCE = 1e-9
NO_SLIP = 0.01  # T / (mu N) that a uniform pressure holds everywhere


@dataclass(frozen=True, eq=False)
class TheoremError:
    """The theorem over the direct solution, less one."""

    face: str
    group: str
    poisson_ratio: float
    direction: str
    given: bool  # whether kappa is that of the direction, or the mean over all
    stiffness: float  # before any slip
    displacement: np.ndarray  # (4,), at the shares of force
    energy: np.ndarray  # (4,), of a cycle, at given force

    @property
    def all(self) -> np.ndarray:
        """Stiffness, displacements, energies, shape (9,)."""
        return np.array([self.stiffness, *self.displacement, *self.energy])


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
    punch_Pa_per_m = punch_pressure_Pa_per_m(face, loaded)
    punch_N_per_m = float(punch_Pa_per_m.sum()) * face.pixel_area_m2
    (energies,) = energies_of_map([punch_Pa_per_m], face.pixel_size_m)
    deviator = energies.deviator * punch_N_per_m / E_STAR_PA
    touches = loaded.pressure_Pa > 0
    punch = replace(loaded, pressure_Pa=touches * loaded.pressure_Pa[touches].mean())
    withdrawn_m, loss_J = np.empty(len(FORCE_SHARES)), np.empty(len(FORCE_SHARES))
    for i, rest in enumerate(1 - np.array(FORCE_SHARES)):
        start_Pa = rest * loaded.pressure_Pa
        lower = press(face, load_N=rest * preload_N, tolerance=TOLERANCE, start_Pa=start_Pa)
        withdrawn_m[i] = loaded.approach_m - lower.approach_m
        gap_m = np.where(lower.pressure_Pa > 0, 0.0, np.maximum(lower.gap_m, 0.0))
        loss_J[i] = 4 * (loaded.pressure_Pa * gap_m).sum() * face.pixel_area_m2
    for nu in POISSON_RATIOS:
        joint = composite((2 * (1 - nu**2) * E_STAR_PA,) * 2, (nu, nu))
        delta_m, W_J = FRICTION * joint.kappa * withdrawn_m, FRICTION**2 * joint.kappa * loss_J
        for direction, along in DIRECTIONS.items():
            force_N = NO_SLIP * held_N * along
            stuck = shear(punch, joint, FRICTION, force_N, tolerance=TOLERANCE)
            slid = [
                shear(loaded, joint, FRICTION, share * held_N * along, tolerance=TOLERANCE)
                for share in FORCE_SHARES
            ]
            stiffness = punch_N_per_m / joint.kappa * (stuck.displacement_m / force_N).real - 1
            displacement = delta_m / [(one.displacement_m / along).real for one in slid] - 1
            energy = W_J / [4 * one.work_J for one in slid] - 1
            found = np.array([stiffness, *displacement, *energy])
            kappa = Lay(joint.kappa, deviator, deviator).kappa(float(np.angle(along)))
            power = np.array([-1.0] + 8 * [1.0])  # of kappa
            for given, factor in ((False, 1.0), (True, (kappa / joint.kappa) ** power)):
                errors = (1.0 + found) * factor - 1.0
                of = errors[0], errors[1:5], errors[5:]
                yield TheoremError(name, group, nu, direction, given, *of)


def paraboloid(ratio: float, n_pixels: int = 96) -> HeightMap:
    """Return a paraboloid whose principal radius along x is `ratio` times that along y."""
    pixel_m = 6.4e-3 / n_pixels
    x = (np.arange(n_pixels) - n_pixels / 2 + 0.5) * pixel_m
    depth_m = (x**2 / ratio + x[:, None] ** 2) * np.sqrt(ratio) / (2 * 20.0)
    return HeightMap(-depth_m, (pixel_m, pixel_m))


def table(found: list[TheoremError]) -> str:
    """Return all rows, and the median and worst sizes of each group, in per cent."""
    shares = "".join(f"{share:14g}" for share in FORCE_SHARES)
    lines = [f"{'displacement / energy, %':38s}  nu  stiffness{shares}"]

    def line(label: str, nu: float, errors: np.ndarray) -> str:
        first, *rest = 100 * errors
        pairs = "".join(f"{rest[i]:7.2f}/{rest[i + 4]:6.2f}" for i in range(4))
        return f"{label:36s} {nu:5g} {first:10.2f}{pairs}"

    said = {False: "", True: ", given"}
    for one in found:
        lines.append(
            line(f"{one.face}, {one.direction}{said[one.given]}", one.poisson_ratio, one.all)
        )
    kinds = [(one.group, one.poisson_ratio, one.given) for one in found]
    for kind in dict.fromkeys(kinds):
        rows = np.array([one.all for one, of in zip(found, kinds, strict=True) if of == kind])
        group, nu, given = kind
        group += said[given]
        means = (rows[::2] + rows[1::2]) / 2
        lines += [
            line(f"{group}: median", nu, np.median(np.abs(rows), axis=0)),
            line(f"{group}: worst", nu, np.abs(rows).max(axis=0)),
            line(f"{group}: worst mean of x and y", nu, np.abs(means).max(axis=0)),
        ]
    return "\n".join(lines)


def main() -> None:
    """Measure a sphere, an elongated paraboloid and the faces of the chart without noise."""
    found = [*theorem_errors(paraboloid(1.0), 20.0, "sphere", "sphere")]
    found += theorem_errors(paraboloid(3.0), 20.0, "paraboloid of radii 3:1", "paraboloid")
    for case in cases():
        if case.group in ("caps", "waves"):
            surface = make_face(case).measured
            found += theorem_errors(surface, case.preload_N, case.name, case.group)
    sys.stdout.write(table(found) + "\n")


if __name__ == "__main__":
    main()
