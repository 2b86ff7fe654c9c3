"""What was found goes back into a simulator: MJCF, URDF, an arm file, JSON."""

from armgap.export.corrected import Corrected
from armgap.export.correction import STAGES, correct
from armgap.export.errors import DiagnosisFileError, ExportError
from armgap.export.fields import FIELDS, FORMATS, Field
from armgap.export.joint import Joint
from armgap.export.links import Links, physical
from armgap.export.read import read_diagnosis

__all__ = [
    "FIELDS",
    "FORMATS",
    "STAGES",
    "Corrected",
    "DiagnosisFileError",
    "ExportError",
    "Field",
    "Joint",
    "Links",
    "correct",
    "physical",
    "read_diagnosis",
]
