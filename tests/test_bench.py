"""``armgap bench``: what it measures is complete and ordered; no time is judged."""

from __future__ import annotations

import json

from armgap.cli.bench import FIELDS, SCHEMES

COUNT = "5000"


def test_every_case_is_measured(run, tmp_path):
    status, out, _ = run("bench", "--samples", COUNT, "--all", "--json", tmp_path / "bench.json")
    assert status == 0
    result = json.loads((tmp_path / "bench.json").read_text())
    cases = {(r["scheme"], r["filters"], r["precision"], r["form"]) for r in result["rows"]}
    assert len(cases) == len(result["rows"]) == len(SCHEMES) * 8
    for row in [*result["rows"], result["noise"]]:
        times = [row[field] for field in FIELDS[1:]]
        assert times == sorted(times)
        assert row["typical_ns"] > 0
    assert all(name in out for name in (*SCHEMES, "noise", "2.5 ms"))


def test_json_alone_and_quiet(run):
    status, out, _ = run("bench", "--samples", COUNT, "--period", "0.001", "--json", "-")
    result = json.loads(out)
    assert (status, result["period_s"], len(result["rows"])) == (0, 0.001, len(SCHEMES) * 4)
    assert all(row["form"] == ("plain" if row["precision"] == "double" else "factorized") for row in result["rows"])
    assert run("bench", "--samples", COUNT, "--quiet") == (0, "", "")


def test_impossible_options(run):
    for options in (("--samples", "0"), ("--period", "-1"), ("--json", "/no/such/folder/x.json")):
        status, out, err = run("bench", *options)
        assert (status, out) == (2, "")
        assert len(err.strip().splitlines()) == 1
