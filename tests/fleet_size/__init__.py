"""A fleet of some hundred entries, some of them broken: one command, restarts, both engines, scaling.

Entries are made from cases of the blind trial (``armgap trial make``): each case is a robot with two visits, whose second one is judged on the log
that the first was trained on. Some are broken, each in another way (`broken`). From the top of the repository::

    armgap trial make -n 250 --duration 3 --seed 1 -o CASES
    python -m tests.fleet_size entries CASES --broken 10 -o FLEET
    python -m tests.fleet_size restart FLEET --kill-after 150
    python -m tests.fleet_size ray FLEET --nodes 2
    python -m tests.fleet_size scaling FLEET --entries 30 --pairs 3
    python -m tests.fleet_size overhead FLEET

==============  ==============================================================================================
file            what
==============  ==============================================================================================
`entries`       manifest and broken files
`broken`        ways in which an entry is broken
`running`       the command killed and started again; the same manifest on a Ray cluster; tables compared
`scaling`       one worker and two, in turns; what the fleet itself costs per entry
==============  ==============================================================================================
"""
