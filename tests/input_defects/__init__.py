"""Trial of the checks of the input: known defects are put into logs and arm files, and the answers of the diagnosis are judged.

The generator of the blind trials makes cases; each entry of the catalogue `defects` puts one defect into a case and states what the answer
has to say; the diagnosis gets only the files with the defect. From the top of the repository::

    python -m tests.input_defects.run --seed 1 --cases 24 --cache /tmp/cases -o defects.jsonl
    python -m tests.input_defects.run --mode clean --seed 1 --cases 200 --cache /tmp/cases -o clean.jsonl
    python -m tests.input_defects.run --mode repaired --seed 1 --cases 60 --cache /tmp/cases -o repaired.jsonl
    python -m tests.input_defects.run --mode floor --seed 1 --cases 300 --cache /tmp/cases -o floor.jsonl
    python -m tests.input_defects.score defects.jsonl clean.jsonl repaired.jsonl floor.jsonl -o docs/input-defects.md

A run that was interrupted is continued: a question that this build of armgap has answered in the output file is not asked again, except with
``--again``. A record keeps what was expected of its answer; ``score --cache`` judges by the catalogue as it is now.

==============  ============================================================================================
file            content
==============  ============================================================================================
`case`          data of a case that a defect changes: tables, an arm file; and the truth
`expected`      what the answer to a case with a defect has to say, and the options that a remedy is written in
`conventions`   defects of convention: signs, order, zeros, gravity
`scales`        defects of unit and meaning: factors, degrees, a position in the place of a torque
`sampling`      defects of time and resolution: shifts, held, filtered, rounded or wrapped samples, irregular time stamps
`stretches`     defects of single rows, of stretches, of whole files and of the arm file
`defects`       the catalogue of all defects
`making`        cases of the trials' generator, kept in a folder with their true motion
`answering`     diagnosis of one case with a defect
`true_floor`    the true noise floor of a case, from its true motion and its known noise
`judging`       judgement of one answer against what was expected
`floors`        noise floors of diagnoses against true ones; verdicts against the gap that remains
`run`, `score`  the two commands; `tables` writes tables of Markdown
==============  ============================================================================================

No module of this package reads or imports ``armgap.check``, so that a mistake made in that package is not repeated in its test.
"""
