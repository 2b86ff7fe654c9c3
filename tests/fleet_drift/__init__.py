"""Delay and false alarms with which a fleet reports that the friction of one robot rises.

Fleets of 20 robots with 30 visits; friction scatters by 10 % from visit to visit on all robots, and one friction parameter of one
robot rises by 3 % per visit after the tenth. After every visit the fleet is asked what drifts. Two reference tests have further knowledge:
one knows the robot, the parameter and the onset, the other only the onset.

``rows``   fleets as tables of estimates: truth times scatter, plus an estimation error of the size that real diagnoses have
``logs``   whole fleets with logs that the blind trial's physics engine makes, one motion per visit, diagnosed by `armgap.fleet.run_fleet`;
           prints the errors of the estimates, and compares the fleet's answers from estimates with those from the true values

From the top of the repository::

    python -m tests.fleet_drift rows --seed 1 --fleets 50
    python -m tests.fleet_drift logs --seed 1 --model pendulum -o FOLDER

==============  ==========================================================================
file            content
==============  ==========================================================================
`truth`         friction of the robots at their visits, and which of them rises
`rows`          tables of estimates made from the true friction
`logs`          logs made from the true friction, and their diagnoses
`judging`       answers of the fleet after every visit; the reference tests; the table
==============  ==========================================================================
"""
