"""The arm of a trial in MuJoCo: plant, actuators, encoders, motions."""
