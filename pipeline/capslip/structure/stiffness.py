"""The two stiffnesses that describe the structure: given, or of a beam."""

from capslip.settings import Settings
from capslip.structure.beam import BeamMode, beam_mode


def stiffnesses(settings: Settings) -> tuple[BeamMode | None, float, float]:
    """Return the stiffnesses K_m and K_s: as given, or of the beam in the settings.

    Parameters
    ----------
    settings : Settings
        `structure`, and `material` for the beam.

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
