"""Fields of simulator formats that effects are written to, and effects without a field."""

from __future__ import annotations

from dataclasses import dataclass

from armgap.literals import SERIAL

__all__ = ["FIELDS", "FORMATS", "Field", "field_of"]

#: Export formats, with the endings of their files.
FORMATS = {"mjcf": ".xml", "urdf": ".urdf", "toml": ".toml", "json": ".json"}


@dataclass(frozen=True)
class Field:
    """Fields in the export formats that an effect is written to; None for a format without a field for it.

    Attributes
    ----------
    mjcf, urdf, toml : str, optional
        Names of the fields in MJCF, URDF and arm files.
    short : str
        What the field does not express of the effect, or reason why no format has a field.
    """

    mjcf: str | None = None
    urdf: str | None = None
    toml: str | None = None
    short: str = ""

    def of(self, form: str) -> str | None:
        """Return the name of the field in a format; JSON has a field for every effect."""
        return "effects" if form == "json" else {"mjcf": self.mjcf, "urdf": self.urdf, "toml": self.toml}[form]


FIELDS: dict[str, Field] = {
    "payload": Field("inertial", "inertial", "inertial.theta"),
    "rotor_inertia": Field(mjcf="joint armature"),
    "joint_spring": Field(mjcf="joint stiffness, springref"),
    "hardening_spring": Field(mjcf="joint stiffness, third coefficient, springref"),
    "quadratic_drag": Field(mjcf="joint damping, second coefficient"),
    "cubic_drag": Field(mjcf="joint damping, third coefficient"),
    "torque_offset": Field(mjcf="general biasprm"),
    "coulomb_asymmetry": Field(
        mjcf="general biasprm",
        short="as a constant torque, which is the same while the joint moves but not while it stands",
    ),
    "torque_gain": Field(mjcf="general gainprm"),
    "torque_saturation": Field(mjcf="general ctrlrange", urdf="limit effort", short="clipped before any lag"),
    "actuator_lag": Field(mjcf="general dyntype filterexact, dynprm"),
    "actuator_delay": Field(mjcf="general delay, nsample", short="in whole time steps"),
    "base_tilt": Field(mjcf="option gravity", urdf="joint origin rpy"),
    "encoder_offset": Field(mjcf="joint ref", urdf="joint origin"),
    "contact": Field(
        mjcf="tendon springlength, stiffness", short="its damping, which acts in contact only, has no field"
    ),
    "joint_elasticity": Field(short="it needs a second body for the rotor, tied to the joint by a spring"),
    "backlash": Field(short="it needs a second body for the rotor, tied to the joint by a limit"),
    "rotor_coupling": Field(mjcf="joint armature of joint 2, inertial"),
    "external_pulse": Field(short="an event of one log, no property of the arm"),
}
"""Fields of effects by name of the effect; an effect not listed has no field in any format but JSON."""

_OF_SERIAL = FIELDS | {
    "payload": Field("inertial", "inertial", "link"),
    "nominal_link": Field("inertial", "inertial", "link"),
    "rotor_inertia": Field(mjcf="joint armature", toml="drive.rotor_inertia"),
    "base_tilt": Field("option gravity", "joint origin rpy", "gravity"),
    "controller_gain": Field(toml="controller.kp"),
    "controller_damping": Field(toml="controller.kd"),
}
_SAME_AS_LINK = "inertial of link 1, whose inertia it adds to without a difference"


def field_of(effect: str, joint: int | None, form: str, kind: str) -> str | None:
    """Return the field of a format that an effect is written to; None if the format has none.

    Parameters
    ----------
    effect : str
        Name of the effect.
    joint : int or None
        Joint of the effect, from 1; None for the whole arm.
    form : str
        Key of `FORMATS`.
    kind : str
        Kind of arm.
    """
    if kind == SERIAL:
        return _OF_SERIAL.get(effect, Field()).of(form)
    if effect == "rotor_inertia" and joint == 1 and form in ("urdf", "toml"):
        return _SAME_AS_LINK if form == "urdf" else "inertial.theta"
    if effect == "base_tilt" and kind == "axis":
        return {"mjcf": "joint axis", "urdf": "joint axis", "toml": "inertial.theta"}.get(form, "effects")
    return FIELDS.get(effect, Field()).of(form)
