"""Folder of a fleet's results: one diagnosis per entry, tables and page; existing results are not computed again."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import polars as pl

from armgap.errors import OptionError, ResultError
from armgap.files.output import write
from armgap.fleet.engines import ENGINES
from armgap.fleet.manifest import Entry
from armgap.fleet.tables import PARAMETERS, SUMMARY, failed_row, parameter_rows, summary_rows
from armgap.fleet.work import Outcome, content_keys

__all__ = ["LIMIT_S", "Fleet", "belongs", "run_fleet"]

LIMIT_S = 600.0
"""Longest time for the diagnosis of one entry of a fleet [s]."""
_DIAGNOSES = "diagnoses"
_SUMMARY, _PARAMETERS, _PAGE = "summary.parquet", "parameters.parquet", "index.html"


def belongs(path: Path) -> bool:
    """Return whether a file or folder in a folder of results is one that a fleet writes."""
    return path.name in (_DIAGNOSES, _SUMMARY, _PARAMETERS, _PAGE)


@dataclass(frozen=True)
class Fleet:
    """Results of the diagnoses of a manifest.

    Attributes
    ----------
    folder : Path
        Folder of the results.
    summary, parameters : polars.DataFrame
        Tables of named causes, and of parameters, see docs/formats.md.
    answered : int
        Number of entries computed by this run; results of other entries existed already.
    settings : mapping
        Keyword arguments of each diagnosis.
    """

    folder: Path
    summary: pl.DataFrame
    parameters: pl.DataFrame
    answered: int
    settings: Mapping[str, Any] = field(default_factory=dict)

    @property
    def failed(self) -> pl.DataFrame:
        """Rows of the summary for entries without a diagnosis, with the reason in the column ``error``."""
        return self.summary.filter(pl.col("error").is_not_null())


def run_fleet(
    entries: Sequence[Entry],
    folder: str | Path,
    settings: Mapping[str, Any] | None = None,
    *,
    engine: str = "local",
    workers: int = 1,
    limit_s: float = LIMIT_S,
    address: str | None = None,
    again: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Fleet:
    """Diagnose every entry that the folder does not hold yet, and write tables and page.

    Parameters
    ----------
    entries : sequence of Entry
        Entries of a manifest, see `read_manifest`.
    folder : path-like
        Folder of results, made if missing. Results belong to the content of logs, arm file and the description that it names, the settings and the
        version; entries whose process died or took too long are tried again by the next run.
    settings : mapping, optional
        Keyword arguments of `armgap.diagnose`, such as ``horizon``.
    engine : str, default "local"
        ``"local"``: processes of this machine; ``"ray"``: a Ray cluster.
    workers : int, default 1
        Number of processes.
    limit_s : float, default 600
        Longest time for one entry [s].
    address : str, optional
        Address of a running Ray cluster.
    again : bool, default False
        Whether to repeat diagnoses whose results exist.
    progress : callable, optional
        Function that is called with the number of entries done and the number of entries to be done.

    Raises
    ------
    OptionError
        If the engine is not known, or the number of workers or the time limit is not above zero.
    ResultError
        If the folder cannot be written to.
    """
    if engine not in ENGINES:
        raise OptionError(f"`{engine}` is no engine", remedy=f"known: {', '.join(ENGINES)}")
    if workers < 1 or limit_s <= 0:
        raise OptionError("workers and the time limit must be above zero", remedy="give 1 or more")
    folder = Path(folder)
    place = folder / _DIAGNOSES
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"cannot be made ({error.strerror or error})", remedy="choose another", file=place) from None
    settings = dict(settings or {})
    keys = content_keys(entries, settings)
    lost: dict[str, Outcome] = {}
    open_entries = {key: entry for entry, key in keys.items() if again or not _stands(place, key)}
    say = progress or (lambda done, total: None)
    say(0, len(open_entries))
    if open_entries:
        run = ENGINES[engine](
            list(open_entries.values()),
            settings,
            workers=min(workers, len(open_entries)),
            limit_s=limit_s,
            address=address,
        )
        for count, (entry, outcome) in enumerate(run, start=1):
            if "lost" in outcome:
                lost[keys[entry]] = outcome
            else:
                _keep(place, keys[entry], outcome)
            say(count, len(open_entries))
    answered = sum(key in open_entries for key in keys.values())
    return _written(folder, keys, lost, answered, settings)


def _file(place: Path, key: str, *, failed: bool = False) -> Path:
    return place / f"{key}.{'error.json' if failed else 'json'}"


def _stands(place: Path, key: str) -> bool:
    return _file(place, key).is_file() or _file(place, key, failed=True).is_file()


def _keep(place: Path, key: str, outcome: Outcome) -> None:
    if "diagnosis" in outcome:
        write(_file(place, key), outcome["diagnosis"])
        _file(place, key, failed=True).unlink(missing_ok=True)
    else:
        write(_file(place, key, failed=True), json.dumps({k: outcome[k] for k in ("error", "seconds")}))
        _file(place, key).unlink(missing_ok=True)


def _written(
    folder: Path, keys: Mapping[Entry, str], lost: Mapping[str, Outcome], answered: int, settings: Mapping[str, Any]
) -> Fleet:
    """Write tables and page from the results in the folder, with one diagnosis in memory at a time."""
    from armgap.fleet.page import fleet_document
    from armgap.report.output import render_report

    summary: list[dict[str, Any]] = []
    parameters: list[dict[str, Any]] = []
    for entry, key in keys.items():
        if key in lost:
            summary.append(failed_row(entry, lost[key]["lost"], lost[key]["seconds"]))
        elif (file := _file(folder / _DIAGNOSES, key)).is_file():
            diagnosis = json.loads(file.read_text(encoding="utf-8"))
            summary += summary_rows(entry, diagnosis)
            parameters += parameter_rows(entry, diagnosis)
        else:
            failed = json.loads(_file(folder / _DIAGNOSES, key, failed=True).read_text(encoding="utf-8"))
            summary.append(failed_row(entry, failed["error"], failed["seconds"]))
    tables = pl.DataFrame(summary, schema=SUMMARY), pl.DataFrame(parameters, schema=PARAMETERS)
    for name, table in zip((_SUMMARY, _PARAMETERS), tables, strict=True):
        write(folder / name, table.write_parquet)
    fleet = Fleet(folder, *tables, answered, settings)
    write(folder / _PAGE, render_report(fleet_document(fleet), {}, _PAGE))
    return fleet
