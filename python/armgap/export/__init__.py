"""What was found goes back into a simulator: MJCF, URDF, an arm file, JSON."""

from armgap.export.corrected import Corrected
from armgap.export.correction import STAGES, correct
from armgap.export.errors import DiagnosisFileError, ExportError
from armgap.export.fields import FIELDS, FORMATS, Field
from armgap.export.joint import Joint
from armgap.export.links import Links, physical
from armgap.export.model import SimulatorModel
from armgap.export.original import CorrectedDescription, into_description
from armgap.export.planar import CorrectedPlanar
from armgap.export.randomization import randomization
from armgap.export.read import read_diagnosis
from armgap.export.serial import CorrectedSerial

__all__ = [
    "FIELDS",
    "FORMATS",
    "STAGES",
    "Corrected",
    "CorrectedDescription",
    "CorrectedPlanar",
    "CorrectedSerial",
    "DiagnosisFileError",
    "ExportError",
    "Field",
    "Joint",
    "Links",
    "SimulatorModel",
    "correct",
    "into_description",
    "physical",
    "randomization",
    "read_diagnosis",
]
