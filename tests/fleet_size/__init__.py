"""Test of a fleet of some hundred entries, some of them broken: one command, restarts, both engines, scaling with workers.

Entries are made from cases of the blind trial (``armgap trial make``): each case is a robot with two visits; the second visit has the first
visit's training log as its holdout. Some entries are broken, each in another way (`broken`). From the top of the repository::

    armgap trial make -n 250 --duration 3 --seed 1 -o CASES
    python -m tests.fleet_size entries CASES --broken 10 -o FLEET
    python -m tests.fleet_size restart FLEET --kill-after 150
    python -m tests.fleet_size ray FLEET --nodes 2
    python -m tests.fleet_size scaling FLEET --entries 30 --pairs 3
    python -m tests.fleet_size overhead FLEET

==============  ==============================================================================================
file            content
==============  ==============================================================================================
`entries`       manifest of the fleet and broken files
`broken`        ways in which an entry is broken
`running`       command killed and started again; the same manifest on a Ray cluster; comparison of the tables
`scaling`       speed of one worker and of two; processor time of the fleet per entry apart from diagnosis
==============  ==============================================================================================
"""
