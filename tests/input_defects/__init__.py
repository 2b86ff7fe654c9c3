"""Known defects put into logs and arm files, and how they are answered.

The generator of the blind trials makes cases; `catalogue` spoils them in one way at a time, each way with what the answer
has to say; the diagnosis gets the spoilt files and nothing else. From the top of the repository::

    python -m tests.input_defects.run --seed 1 --cases 24 --cache /tmp/cases -o defects.jsonl
    python -m tests.input_defects.run --mode clean --seed 1 --cases 200 --cache /tmp/cases -o clean.jsonl
    python -m tests.input_defects.run --mode repaired --seed 1 --cases 60 --cache /tmp/cases -o repaired.jsonl
    python -m tests.input_defects.run --mode floor --seed 1 --cases 300 --cache /tmp/cases -o floor.jsonl
    python -m tests.input_defects.score defects.jsonl clean.jsonl repaired.jsonl floor.jsonl -o docs/input-defects.md

Every run goes on where it stopped: what this build has answered in the output file is not asked again (``--again`` does so). A record
keeps what was expected of it; ``score --cache`` judges by the catalogue as it is now.

==============  ============================================================================================
file            what
==============  ============================================================================================
`case`          what a defect acts on: tables, an arm file, the truth
`expected`      what an answer has to say, and the options that a remedy is written in
`conventions`   defects of convention: signs, order, zeros, gravity
`scales`        defects of unit and meaning: factors, degrees, a position in the place of a torque
`sampling`      defects of time and resolution: shifts, held, filtered, rounded, wrapped, scattered stamps
`stretches`     defects of single rows, of stretches, of whole files and of the arm file
`defects`       the catalogue of all of them
`making`        cases of the generator, kept in a folder with their true motion
`answering`     one spoilt case diagnosed
`true_floor`    the floor that a case has, from its true motion and its known noise
`judging`       one answer against what was expected
`floors`        claimed floors against true ones; verdicts against what remains
`run`, `score`  the two commands; `tables` writes Markdown
==============  ============================================================================================

Nothing here reads or imports ``armgap.check``: a mistake made there is not made here again.
"""
