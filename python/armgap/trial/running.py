"""Answers of one method to many cases, in parallel processes; existing answers are kept.

The answer to ``DIR/case-0007`` by method M is ``DIR/answers/M/case-0007.json``. An answer is kept when it belongs to
the case (its seal) and to the software (its version), and is no failure. Keys stay closed: a method receives a `SealedCase`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from concurrent.futures import TimeoutError as TookTooLong
from pathlib import Path

from armgap.errors import ArmgapError, ResultError
from armgap.files.output import write
from armgap.trial.answers import Answer
from armgap.trial.cases.key import sealed_hash
from armgap.trial.cases.layout import ANSWERS
from armgap.trial.cases.sealed import SealedCase, case_folders
from armgap.trial.methods import Method, methods
from armgap.trial.simulation.engine import worker_pool
from armgap.workers import one_thread

__all__ = ["ANSWERS", "answer_cases", "answer_file", "open_cases"]

#: Default time limit of a method for one case, s.
_LIMIT_S = 300.0


def answer_file(case: Path, method: str) -> Path:
    """Return the path of the answer of a method to a case."""
    return case.parent / ANSWERS / method / f"{case.name}.json"


def open_cases(folder: str | Path, method: Method, again: bool = False) -> list[Path]:
    """Return the folders of the cases that a method has not answered yet; of all cases if `again`."""
    return [c for c in case_folders(folder) if again or not _answered(c, method)]


def answer_cases(
    cases: list[Path], method: Method, *, workers: int = 1, limit_s: float = _LIMIT_S
) -> Iterator[tuple[Path, Answer]]:
    """Let a method answer cases, in processes of one thread each; each answer is written as soon as it is given.

    Parameters
    ----------
    cases : list of Path
        Case folders.
    method : Method
        Method that answers, one of `methods`.
    workers : int, default 1
        Number of processes.
    limit_s : float, default 300
        Longest time for one case [s]; a case that takes longer has an answer with an error.

    Yields
    ------
    tuple of Path and Answer
        Case folder and answer, in order of the cases.
    """
    if not cases:
        return
    with one_thread(), worker_pool(min(workers, len(cases))) as pool:
        futures = [pool.schedule(_answer, args=[str(c), method.name], timeout=limit_s) for c in cases]
        try:
            for case, future in zip(cases, futures, strict=True):
                answer = _result(future.result, case, method, limit_s)
                _write(answer_file(case, method.name), answer)
                yield case, answer
        finally:
            pool.stop()


def _result(result: Callable[[], Answer], case: Path, method: Method, limit_s: float) -> Answer:
    """Return the answer of a worker process; if it took too long or failed, an answer that states the error."""
    from pebble import ProcessExpired

    try:
        return result()
    except TookTooLong:
        reason = f"took longer than {limit_s:g} s"
    except ProcessExpired as end:
        reason = f"its process ended with status {end.exitcode}"
    failed = Answer(method.name, "none", error=reason)
    return failed.stamped(sealed_hash(case), method.version(), limit_s)


def _answer(case: str, name: str) -> Answer:
    """Return the answer of a method to one case, in its own process; errors of armgap and failures of a baseline become answers."""
    method = methods()[name]
    start = time.process_time()
    try:
        sealed = SealedCase.read(case)
        start = time.process_time()
        answer = method.answer(sealed)
    except (ArmgapError, ArithmeticError, ValueError, RuntimeError, LookupError) as error:
        answer = Answer(name, "none", error=f"{type(error).__name__}: {error}")
    return answer.stamped(sealed_hash(case), method.version(), time.process_time() - start)


def _answered(case: Path, method: Method) -> bool:
    try:
        answer = Answer.from_json(answer_file(case, method.name).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return answer.error is None and answer.seal == sealed_hash(case) and answer.version == method.version()


def _write(path: Path, answer: Answer) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(
            f"cannot be made ({error.strerror})", remedy="choose another place", file=path.parent
        ) from None
    write(path, answer.to_json())
