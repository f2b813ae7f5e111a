"""The result of one analysis: all that the stages found. Its numbers: `capslip.summary`."""

from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any

import capslip
from capslip.caps.families import Families
from capslip.caps.hills import Hills
from capslip.caps.iso25178 import Iso25178
from capslip.caps.table import CapTable
from capslip.contact.joint import Joint
from capslip.contact.levelling import Level
from capslip.contact.part_of_joint import left_open
from capslip.contact.press import ContactState
from capslip.contact.slip import SlipCurve
from capslip.errors import check_kind, check_text
from capslip.problems import Problem
from capslip.sensitivity import Sensitivity
from capslip.settings import Settings
from capslip.stages import Face
from capslip.structure.answer import Answer
from capslip.structure.band import Band
from capslip.structure.band_state import Part
from capslip.structure.beam import BeamMode
from capslip.structure.response import Damping
from capslip.structure.stiffness import structure_name
from capslip.summary import (
    alignment_table,
    contact_table,
    damping_table,
    hills_table,
    plain,
    scan_table,
    slip_table,
    summary_of,
    surface_table,
)
from capslip.surface.conditioning import Conditioned
from capslip.surface.heightmap import HeightMap, Origin
from capslip.surface.noise import known_noise_m
from capslip.verdict import verdict

if TYPE_CHECKING:
    from capslip.output.arrays import Tables
    from capslip.output.plots import Plots


@dataclass(frozen=True, eq=False, kw_only=True)
class JointResult:
    """What is known of a joint, from a scan or not; the stages that could not run are None."""

    settings: Settings
    joint: Joint
    families: Families | None = None  # None: those of each scan are its own
    contact: ContactState | None = None
    slip: SlipCurve | None = None
    beam: BeamMode | None = None  # None where the settings give the two stiffnesses
    damping: Damping | None = None
    answer: Answer | None = None  # None: beyond gross slip, too
    band: Band | None = None  # None: nothing is known to be uncertain, too
    problems: tuple[Problem, ...]
    timings_s: dict[str, float]
    started: str

    @property
    def name(self) -> str:
        """What the result is called."""
        return "families"

    @property
    def status(self) -> str:
        """Return "failed" with an error among the problems, "check" with a warning, or "ok"."""
        severities = {p.severity for p in self.problems}
        if "error" in severities:
            return "failed"
        return "check" if "warning" in severities else "ok"

    @property
    def verdict(self) -> str:
        """Return one sentence on what the result is usable for."""
        errors = self.estimated_error, self.errors_of_answer
        each = (left_open(part.joint, part.contact) for part in self.parts)
        part_within = next((one.energy_up_to for one in each if one is not None), None)
        known = self.noise_known
        return verdict(
            self.settings, self.problems, *errors, noise_known=known, part_within=part_within
        )

    @property
    def noise_known(self) -> bool:
        """Tell whether somebody says the measurement noise: the settings, or the scans."""
        return self.settings.instrument.noise_m is not None

    @property
    def estimated_error(self) -> float | None:
        """Return that of the contact model, of energy at given force and of stiffness."""
        return self.contact.estimated_error if self.contact else None

    @property
    def parts(self) -> tuple[Part, ...]:
        """What is known of how the joint is pressed; nothing where it has no slip curve."""
        if self.contact is None or self.slip is None:
            return ()
        return (Part(self.joint, self.contact, 1.0),)

    @property
    def error_of_answer(self) -> float | None:
        """Return that of the contact model at the force of the answer, the greatest of parts."""
        both = self.errors_of_answer
        return None if both is None else max(both)

    @property
    def errors_of_answer(self) -> tuple[float, float] | None:
        """Return those of stiffness and energy at that force, of each the greatest of parts."""
        errors = [part.contact.errors for part in self.parts]
        if self.answer is None or self.slip is None or not self.answer.slip_force_N > 0.0:
            return None
        share = self.answer.slip_force_N / float(self.slip.total_slip_force_N)
        known = [one.both_at(share) for one in errors if one is not None]
        if not known or len(known) < len(errors):
            return None
        stiffness, energy = (max(each) for each in zip(*known, strict=True))
        return stiffness, energy

    def summary(
        self, command: str | None = None, timings_s: dict[str, float] | None = None
    ) -> dict[str, Any]:
        """Return the dictionary of `summary.json`: plain numbers, strings, lists, dictionaries.

        Parameters
        ----------
        command : str, optional
            The command line, for the record.
        timings_s : dict, optional
            Seconds of what was done outside the analysis (reading, drawing, ...).
        """
        check_text("command", command)
        check_kind("timings_s", timings_s, (dict, type(None)), "a dictionary, or None")
        return summary_of(self, command, timings_s)

    def of_the_scan(self, texture: bool) -> dict[str, Any]:
        """Return the tables of what a scan shows; `surface` is null without its texture."""
        return {}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Analysis(JointResult):
    """All that one analysis of a scan found; the stages that could not run are None.

    Examples
    --------
    >>> from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
    >>> scene = Scene((100, 150), (4e-4, 4e-4), families=(CapFamily("G", 6, 24.0),))
    >>> analysis = capslip.analyze(synthetic_surface(scene)[0])
    >>> len(analysis.tables.caps), f"{analysis.slip.total_slip_force_N:.1f} N"
    (6, '92.0 N')
    """

    families: Families
    surface: HeightMap
    conditioned: Conditioned  # with the surface at the level at which it is pressed
    level: Level | None  # None: as levelled
    hills: Hills
    caps: CapTable
    sensitivity: Sensitivity | None = None  # None where it was not asked for
    iso25178: Iso25178  # of the conditioned map, computed when they are asked for
    mate: Origin | None  # of the other face, where there is one

    @property
    def name(self) -> str:
        """Name of the scan."""
        return self.surface.origin.name

    @property
    def face(self) -> Face:
        """What was pressed; of its families nobody asks any more."""
        of_two = self.mate is not None and self.settings.mating.way == "together"
        found = self.joint, self.conditioned, self.level, self.hills, self.caps, self.families
        return Face(*found, None if of_two else self.hills.label, self.caps, ())

    @property
    def noise_known(self) -> bool:
        """Tell whether the settings or the scan say the measurement noise."""
        return known_noise_m(self.conditioned.surface, self.settings) is not None

    @property
    def plot(self) -> "Plots":
        """The figures, each a method that returns Matplotlib axes: `analysis.plot.loop()`."""
        return capslip.Plots(self)

    @property
    def tables(self) -> "Tables":
        """The numbers as NumPy structured arrays: `analysis.tables.caps["radius_m"]`."""
        return capslip.Tables(self)

    def __repr__(self) -> str:
        contact, peak = contact_table(self), damping_table(self)["peak_loss_factor"]
        of = structure_name(self.settings)
        n, found = len(self.problems), "problem" if len(self.problems) == 1 else "problems"
        loss = "no loss factor" if peak is None else f"loss factor {peak:.3g} of the {of}"
        return (
            f"<Analysis of {self.name}: {self.status}, {self.caps.usable.sum()} caps, "
            f"{contact['model'] or 'no contact'} at {contact['preload_N']:g} N, {loss}, "
            f"{n} {found}>"
        )

    def _repr_html_(self) -> str:
        """Return a small table, for notebooks."""
        slip, damping = plain(slip_table(self)), plain(damping_table(self))
        rows = {
            "verdict": self.verdict,
            "caps": int(self.caps.usable.sum()),
            "m, n on the families' own plane": f"{self.families.m}, {self.families.n}",
            "contact model": self.contact.model if self.contact else None,
            "preload [N]": float(self.joint.preload_N),
            "tangential stiffness [N/m]": slip["tangential_stiffness_N_per_m"],
            f"greatest loss factor, {damping['structure']}": damping["peak_loss_factor"],
            "gross slip amplitude [m]": damping["gross_slip_amplitude_m"],
            **{problem.code: problem.text for problem in self.problems},
        }
        body = "".join(
            f"<tr><th>{escape(name)}</th><td>{_cell(value)}</td></tr>"
            for name, value in rows.items()
        )
        caption = f"{escape(self.name)}: {self.status}"
        return f"<table><caption>{caption}</caption>{body}</table>"

    def of_the_scan(self, texture: bool) -> dict[str, Any]:
        """Return the tables of the scan, its hills, how it lies in the contact, and the sweeps."""
        return {
            "surface": surface_table(self) if texture else None,
            "hills": hills_table(self),
            "contact": {**contact_table(self), **alignment_table(self)},
            "sensitivity": self.sensitivity.to_dict() if self.sensitivity else None,
        }


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class JointOfScans(JointResult):
    """A joint of which several scans are known, each of which was analysed as if it were alone."""

    scans: tuple[Analysis, ...]

    @property
    def name(self) -> str:
        """What the result is called."""
        return "scans"

    @property
    def known(self) -> tuple[Analysis, ...]:
        """The scans that have a slip curve, so of which the joint is made."""
        return tuple(scan for scan in self.scans if scan.slip is not None)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Each of these as a part of the joint, which it stands for by its share of their area."""
        parts = [part for scan in self.scans for part in scan.parts]
        area_m2 = [part.joint.scan_area_m2 or 0.0 for part in parts]
        shares = [one_m2 / sum(area_m2) for one_m2 in area_m2]
        return tuple(replace(part, share=share) for part, share in zip(parts, shares, strict=True))

    @property
    def verdict(self) -> str:
        """Return one sentence on what the result is usable for, and on how many scans it rests."""
        count = (len(self.known), len(self.scans))
        errors = self.estimated_error, self.errors_of_answer
        return verdict(self.settings, self.problems, *errors, count, self.noise_known)

    @property
    def noise_known(self) -> bool:
        """Tell whether the measurement noise of each scan is known."""
        return all(scan.noise_known for scan in self.scans)

    @property
    def estimated_error(self) -> float | None:
        """Return the greatest of the scans; None where that of one is not known."""
        errors = [scan.estimated_error for scan in self.known]
        known = [error for error in errors if error is not None]
        return max(known) if known and len(known) == len(errors) else None

    def of_the_scan(self, texture: bool) -> dict[str, Any]:
        """Return a table for each scan."""
        area_m2 = sum(scan.joint.scan_area_m2 or 0.0 for scan in self.known)
        return {"scans": [scan_table(scan, area_m2) for scan in self.scans]}


def _cell(value: object) -> str:
    if value is None:
        return "–"
    return f"{value:.4g}" if isinstance(value, float) else escape(str(value))
