"""MuJoCo simulation of a trial's arm: plant, actuators, encoders, motions."""
