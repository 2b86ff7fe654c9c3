"""The next experiment, checked in another simulator: what a plan promises beside what its motion, played in MuJoCo, lets a diagnosis say."""
