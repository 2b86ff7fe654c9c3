"""Trial of planned motions: evidence that a plan expects, and what a diagnosis names after its motion was simulated in MuJoCo."""
