"""Export of a diagnosed arm to simulators: MJCF, URDF, an arm file, JSON."""

from armgap.export.chain.joint import Joint
from armgap.export.chain.links import Links, physical
from armgap.export.chain.model import SimulatorModel
from armgap.export.chain.planar import CorrectedPlanar
from armgap.export.chain.serial import CorrectedSerial
from armgap.export.corrected import Corrected
from armgap.export.correction import STAGES, correct
from armgap.export.errors import DiagnosisFileError, ExportError
from armgap.export.fields import FIELDS, FORMATS, Field
from armgap.export.formats.original import CorrectedDescription, into_description
from armgap.export.randomization import randomization
from armgap.export.read import read_diagnosis

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
