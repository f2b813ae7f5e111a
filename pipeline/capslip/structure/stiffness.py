"""The structure: two stiffnesses that describe it, given or of a beam, and what it is called."""

from capslip.settings import Settings
from capslip.structure.beam import BeamMode, beam_mode


def structure_name(settings: Settings) -> str:
    """Return what the numbers of the structure are those of; a beam nobody gave is named so.

    Examples
    --------
    >>> structure_name(Settings())
    'demonstration beam 400 x 60 x 40 mm'
    """
    if settings.structure.modal_stiffness_N_per_m is not None:
        return "structure"
    beam = settings.structure.beam
    sides = " x ".join(
        f"{1e3 * side_m:.4g}" for side_m in (beam.length_m, beam.width_m, beam.thickness_m)
    )
    moduli_Pa = settings.material.youngs_modulus_Pa
    of = "" if moduli_Pa[0] == moduli_Pa[1] else f", E {1e-9 * moduli_Pa[0]:.4g} GPa"
    return f"{'' if is_given(settings) else 'demonstration '}beam {sides} mm{of}"


def is_given(settings: Settings) -> bool:
    """Return whether someone gave a structure."""
    given = settings.structure.modal_stiffness_N_per_m is not None
    return given or settings.is_given("structure.beam")


def stiffnesses(settings: Settings) -> tuple[BeamMode | None, float, float]:
    """Return the stiffnesses K_m and K_s: as given, or of the beam in the settings.

    Parameters
    ----------
    settings : Settings
        `structure`, and `material` for the beam: the first of two.

    Returns
    -------
    BeamMode or None, float, float
        The beam's mode (None where the settings give the stiffnesses), K_m and K_s in N/m.

    Raises
    ------
    SettingsError
        If the sizes of the beam make none.
    """
    structure = settings.structure
    modal, joint = structure.modal_stiffness_N_per_m, structure.joint_stiffness_N_per_m
    if modal is not None and joint is not None:
        return None, modal, joint
    beam = beam_mode(
        length_m=structure.beam.length_m,
        width_m=structure.beam.width_m,
        thickness_m=structure.beam.thickness_m,
        density_kg_per_m3=structure.beam.density_kg_per_m3,
        youngs_modulus_Pa=settings.material.youngs_modulus_Pa[0],
        poisson_ratio=settings.material.poisson_ratio[0],
        joint_position_m=structure.beam.joint_position_m,
        theory=structure.beam.theory,
    )
    return beam, beam.modal_stiffness_N_per_m, beam.joint_stiffness_N_per_m
