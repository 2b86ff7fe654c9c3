"""How soon a fleet says that the friction of one robot rises, and how often it says so for nothing.

Fleets of 20 robots with 30 visits; friction scatters by 10 % from visit to visit on all robots, and one friction parameter of one
robot rises by 3 % per visit after the tenth. After every visit the fleet is asked what drifts, and so are two tests that know
more: one knows the robot, the parameter and the onset, the other the onset only.

``rows``   fleets on the level of the table of estimates: truth times scatter, plus an estimation error of the size that real diagnoses have
``logs``   whole fleets with logs that the blind trial's physics engine makes, one motion per visit, diagnosed by `armgap.fleet.run_fleet`;
           what their estimates miss by, and whether the fleet answers from them as it does from the true values

From the top of the repository::

    python -m tests.fleet_drift rows --seed 1 --fleets 50
    python -m tests.fleet_drift logs --seed 1 --model pendulum -o FOLDER

==============  ==========================================================================
file            what
==============  ==========================================================================
`truth`         friction of the robots at their visits, and which of them rises
`rows`          tables of estimates made from it
`logs`          logs made from it, and their diagnoses
`judging`       the fleet asked after every visit; the tests that know more; the table
==============  ==========================================================================
"""
