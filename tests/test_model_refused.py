"""Descriptions, arm files and logs of serial arms that are broken: refused in one line that says what to do."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from armgap import Arm, Log, read_model
from armgap.errors import ArmgapError, ColumnError
from three_joints import ARM, JOINTS, LINKS, URDF, motion, refused

Run = Callable[..., tuple[int, str, str]]

ELBOW = '<joint name="elbow" type="revolute">'
#: What is replaced in URDF by what, the words of the complaint, and further options.
BROKEN = [
    ("no such tip", "", "", ("`flnge`", "did you mean `flange`"), ("--tip", "flnge")),
    ("no such base", "", "", ("`bse`", "did you mean `base`"), ("--base", "bse", "--tip", "flange")),
    ("tip above base", "", "", ("`column`", "`fore`", "flange"), ("--base", "fore", "--tip", "column")),
    ("several branches", "", "", ("several branches", "`flange` (3 joints), where they part", "`jaw` (4 joints)"), ()),
    ("nothing moves", "", "", ("no joint moves", "`flange`"), ("--base", "fore", "--tip", "flange")),
    ("no joint to freeze", "", "", ("`finge`", "did you mean `finger`"), ("--freeze", "finge=0")),
    ("frozen at no number", "", "", ("--freeze", "finger=open"), ("--freeze", "finger=open")),
    ("frozen twice", "", "", ("given twice",), ("--freeze", "finger=0", "--freeze", "finger=1")),
    ("sample period in ms", "", "", ("2", "1e-05 to 0.5"), ("--tip", "flange", "--sample-period", "2")),
    ("a mimic joint in the chain", "", "", ("`joint thumb`", "follows the joint `finger`", "freeze"), ("--tip", "pad")),
    ("floating", ELBOW, ELBOW.replace("revolute", "floating"), ("`joint elbow`", "floating", "`fore`"), ("--tip", "flange")),
    ("planar", ELBOW, ELBOW.replace("revolute", "planar"), ("`joint elbow`", "planar"), ("--tip", "flange")),
    ("no type", ' type="revolute"', "", ("`joint elbow`", "no type", "continuous"), ()),
    ("unknown type", "revolute", "hinge", ("`hinge`", "revolute"), ()),
    ("zero axis", 'xyz="0 0 2"', 'xyz="0 0 0"', ("`joint lift`", "zero axis"), ("--tip", "flange")),
    ("axis of two numbers", 'xyz="0 0 2"', 'xyz="0 2"', ("`axis`", "row 4", "3 finite numbers"), ()),
    ("decimal comma", 'value="6"', 'value="6,5"', ("`mass`", "'6,5'", "row 6"), ()),
    ("mass is nan", 'value="6"', 'value="nan"', ("'nan'", "finite"), ()),
    ("no mass value", 'mass value="6"', "mass", ("has no `value`",), ()),
    ("no child", '<child link="fore"/>', "", ("`joint elbow`", "no child link"), ()),
    ("child is no link", '<child link="fore"/>', '<child link="four"/>', ("`joint elbow`", "`four`"), ()),
    ("two parents", '<child link="pad"/>', '<child link="jaw"/>', ("`joint thumb`", "`finger`", "closed chains"), ()),
    ("a circle", '<parent link="base"/>', '<parent link="fore"/>', ("circle",), ()),
    ("link twice", '<link name="mount"/>', '<link name="mount"/><link name="mount"/>', ("`link mount`", "twice"), ()),
    ("joint twice", '"wrist"', '"elbow"', ("`joint elbow`", "twice"), ()),
    ("joint without a name", 'joint name="lift" type', "joint type", ("`joint`", "has no name"), ()),
    ("not XML", "</robot>", "", ("not valid XML", "row"), ()),
    ("xacro by its elements", "<vendor:thing", "<xacro:thing", ("xacro", "robot.urdf", "`xacro:thing`"), ()),
    ("xacro by its values", 'value="6"', 'value="${m}"', ("${m}", "xacro FILE"), ()),
    ("xacro by its names", '<link name="base">', '<link name="${prefix}base">', ("`link ${prefix}base`", "xacro FILE"), ()),
    ("SDF", URDF, "<sdf><model/></sdf>", ("<sdf>", "convert"), ()),
    ("a table", URDF, "t,q1\n0,1\n", ("no XML", "<robot>"), ()),
    ("empty", URDF, "", ("no XML",), ()),
    ("no links", URDF, "<robot name='r'/>", ("no links",), ()),
    ("an entity", '<robot name', '<!DOCTYPE robot [<!ENTITY a "b">]><robot name',
     ("row 2", "declares an entity", "xmllint --noent --dropdtd"), ()),
    ("reduction of no number", "<vendor:thing", '<transmission name="t"><joint name="lift"/><actuator name="m"><mechanicalReduction>x'
     "</mechanicalReduction></actuator></transmission><vendor:thing", ("mechanicalReduction", "'x'"), ()),
    ("a kilometre too many", 'xyz="0.1 0 0.2"', 'xyz="1e300 0 0"', ("too long to compute with", "kg and m"), ("--tip", "flange")),
    ("folder that is not there", "", "", ("folder does not exist",), ("--tip", "flange", "-o", "none/arm.toml")),
]  # fmt: skip


@pytest.mark.parametrize(("good", "bad", "says", "options"), [c[1:] for c in BROKEN], ids=[c[0] for c in BROKEN])
def test_a_broken_description(
    good: str, bad: str, says: tuple[str, ...], options: tuple[str, ...], three: Path, run: Run
) -> None:
    assert good in URDF
    (three / "three.urdf").write_text(URDF.replace(good, bad, 1))
    before = sorted(three.iterdir())
    output = () if "-o" in options else ("-o", "made.toml")
    refused(run("model", "three.urdf", *options, *output), says)
    assert sorted(three.iterdir()) == before


#: What is replaced in ARM, or LINKS, by what, and the words of the complaint.
BROKEN_ARMS = [
    ("misspelt key", ARM, "tip =", "tpi =", ("`tpi`", "did you mean `tip`")),
    ("no description", ARM, 'urdf = "three.urdf"\n', "", ("exactly one of urdf, mjcf and [[link]]",)),
    ("two descriptions", ARM, "tip =", 'mjcf = "x.xml"\ntip =', ("`mjcf`", "stands beside `urdf`")),
    ("not that kind of description", ARM, "urdf =", "mjcf =", ("is URDF, not MJCF",)),
    ("no such description", ARM, "three.urdf", "thre.urdf", ("thre.urdf", "No such file")),
    ("base parameters", ARM, "[friction]", "[inertial]\ntheta = [1]\n[friction]", ("`inertial`", "[[link]]")),
    ("lengths", ARM, "[friction]", "[geometry]\nlink_length = [1]\n[friction]", ("`geometry`", "leave it out")),
    ("unknown trust", ARM, "tip =", 'trust = "CAD"\ntip =', ("`trust`", "`CAD`")),
    ("gravity of two", ARM, "tip =", "gravity = [0, -9.81]\ntip =", ("`gravity`", "3 numbers")),
    ("gravity too strong", ARM, "tip =", "gravity = [0, 0, -9810]\ntip =", ("`gravity`", "9810")),
    ("too few frictions", ARM, "[8.0, 1.5, 0.7]", "[8.0]", ("`friction.coulomb`", "lift, shoulder, elbow")),
    ("friction of no joint", ARM, "[8.0, 1.5, 0.7]", "{lift = 8, shoulder = 2, elbw = 1}", ("did you mean `elbow`",)),
    ("friction lacks a joint", ARM, "[8.0, 1.5, 0.7]", "{lift = 8, shoulder = 2}", ("lacks the joint `elbow`",)),
    ("negative friction", ARM, "1.5", "-1.5", ("`friction.coulomb`", "-1.5")),
    ("frozen at a word", ARM, "[friction]", '[frozen]\nfinger = "open"\n[friction]', ("`frozen.finger`", "'open'")),
    ("limits exchanged", ARM, "[friction]", "[limits]\nposition_max = [-1, 1, 1]\n[friction]", ("`lift`", "exchange")),
    ("payload without a mass", ARM, "[friction]", "[payload]\ncom = [0, 0, 0]\n[friction]", ("`payload.mass`",)),
    ("payload far away", ARM, "[friction]", "[payload]\nmass = 1\ncom = [0, 0, 300]\n[friction]", ("in m",)),
    ("controller without gains", ARM, "[friction]", "[controller]\nkp = [1, 2, 3]\n[friction]", ("`controller.kd`",)),
    ("controller of no kind", ARM, "[friction]", '[controller]\nkind = "mpc"\n[friction]', ("'mpc'", "pd")),
    ("gear ratios twice", ARM, "[friction]", "[drive]\ngear_ratio = [1, 2, 3]\n[transmission]\ngear_ratio = [1, 2, 3]\n[friction]",
     ("`transmission.gear_ratio`", "`drive.gear_ratio`")),
    ("column of no joint", ARM, "[friction]", '[columns]\nq_ref4 = "x"\n[friction]', ("`columns.q_ref4`",)),
    ("kind of torque", ARM, "[friction]", '[columns]\ntau_kind = "guessed"\n[friction]', ("`columns.tau_kind`", "measured")),
    ("joint twice", LINKS, '"two"', '"one"', ("`link 2.joint`", "twice")),
    ("no joint", LINKS, 'joint = "two"\n', "", ("`link 2.joint`", "is missing")),
    ("misspelt key of a link", LINKS, "com =", "con =", ("`link 1.con`", "did you mean `com`")),
    ("axis of zeros", LINKS, "[0, 1, 0]", "[0, 0, 0]", ("`link 1.axis`", "zero")),
    ("axis of words", LINKS, "[0, 1, 0]", '["y", 1, 0]', ("`link 1.axis`", "3 numbers")),
    ("kind of joint", LINKS, "axis =", 'kind = "ball"\naxis =', ("`link 1.kind`", "`ball`", "revolute")),
    ("no rotation", LINKS, "rpy = [0, 0.1, 0]", "rotation = [[1, 0, 0], [0, 2, 0], [0, 0, 1]]", ("is no rotation",)),
    ("two rotations", LINKS, "rpy = [0, 0.1, 0]", "rpy = [0, 0, 0], rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]", ("`rotation`",)),
    ("massless with a centre", LINKS, "mass = 2.0\n", "", ("`link 1.mass`", "`com`")),
    ("negative mass of a link", LINKS, "mass = 2.0", "mass = -2.0", ("`link 1.mass`", "-2")),
    ("half an inertia", LINKS, "iyy = 0.03, ", "", ("`link 1.inertia.iyy`",)),
    ("inertia as a list", LINKS, "{ixx = 0.03, iyy = 0.03, izz = 0.01}", "[1, 2, 3]", ("`link 1.inertia`", "ixx")),
    ("a mass of any size", LINKS, "mass = 2.0\ncom = [0, 0, 0.2]", "mass = 1e300\ncom = [0, 0, 1e9]", ("`link`", "too heavy")),
    ("links and a tip", LINKS, "[[link]]", 'tip = "x"\n[[link]]', ("`tip`", "[[link]]")),
]  # fmt: skip


@pytest.mark.parametrize(("text", "good", "bad", "says"), [c[1:] for c in BROKEN_ARMS], ids=[c[0] for c in BROKEN_ARMS])
def test_a_broken_arm_file(text: str, good: str, bad: str, says: tuple[str, ...], three: Path, run: Run) -> None:
    assert good in text
    (three / "arm.toml").write_text(text.replace(good, bad, 1))
    motion().write_csv(three / "log.csv")
    refused(run("inspect", "log.csv", "--arm", "arm.toml"), says)


# Logs


def test_columns_are_found_by_the_names_of_joints(three: Path) -> None:
    """In any order, beside columns of other joints."""
    arm, frame = Arm.read(three / "arm.toml"), motion()
    for columns in (frame.columns, frame.columns[::-1]):
        log = Log.from_frame(frame.select(columns).with_columns(pl.lit(0.02).alias("finger/position")), arm=arm)
        for j, joint in enumerate(JOINTS):
            np.testing.assert_array_equal(log.q[:, j], frame[f"{joint}/position"])
            np.testing.assert_array_equal(log.tau[:, j], frame[f"{joint}/effort"])
            assert log.dq is not None
            np.testing.assert_array_equal(log.dq[:, j], frame[f"{joint}/velocity"])
        assert [log.units[f"q{j}"] for j in (1, 2, 3)] == ["m", "rad", "rad"]
        assert [log.units[f"tau{j}"] for j in (1, 2, 3)] == ["N", "Nm", "Nm"]


def test_stray_standard_names_do_not_hide_the_joints_columns(three: Path) -> None:
    """One column `tau1` beside the efforts of all joints is left out, and said; it is used where it is asked for."""
    arm, frame = Arm.read(three / "arm.toml"), motion()
    stray = frame.with_columns(pl.lit(1.0).alias("tau1"), pl.lit(2.0).alias("dq2"))
    log = Log.from_frame(stray, arm=arm)
    for j, joint in enumerate(JOINTS):
        np.testing.assert_array_equal(log.tau[:, j], frame[f"{joint}/effort"])
    said = [finding.message for finding in log.findings if finding.kind == "columns"]
    assert [("`tau1`" in text, "`dq2`" in text) for text in said] == [(False, True), (True, False)]
    asked = Log.from_frame(stray.with_columns(tau1=frame["lift/effort"] + 1), arm=arm, columns={"tau1": "tau1"})
    np.testing.assert_array_equal(asked.tau[:, 0], frame["lift/effort"] + 1)
    np.testing.assert_array_equal(asked.tau[:, 1], frame["shoulder/effort"])


def test_columns_by_both_names_are_refused(three: Path) -> None:
    arm, frame = Arm.read(three / "arm.toml"), motion()
    both = frame.with_columns(
        (2 * pl.col(f"{joint}/effort")).alias(f"tau{j}") for j, joint in enumerate(JOINTS, start=1)
    )
    with pytest.raises(ColumnError, match=r"`tau1`: stands beside `lift/effort`.*joint 1.*--columns tau1=tau1"):
        Log.from_frame(both, arm=arm)
    standard = Log.from_frame(both, arm=arm, columns={f"tau{j}": f"tau{j}" for j in (1, 2, 3)})
    np.testing.assert_array_equal(standard.tau, 2 * Log.from_frame(frame, arm=arm).tau)


def test_explicit_columns_win(three: Path) -> None:
    frame = motion().with_columns((2 * pl.col("elbow/effort")).alias("elbow current"))
    (three / "arm.toml").write_text(ARM + '[columns]\ntau3 = "elbow current"\nq_ref1 = "target"\n')
    arm = Arm.read(three / "arm.toml")
    np.testing.assert_array_equal(Log.from_frame(frame, arm=arm).tau[:, 2], frame["elbow current"])
    np.testing.assert_array_equal(
        Log.from_frame(frame, arm=arm, columns={"tau3": "elbow/effort"}).tau[:, 2], frame["elbow/effort"]
    )
    written = Log.from_frame(frame, arm=arm).to_polars()
    np.testing.assert_array_equal(Log.from_frame(written, arm=arm).tau[:, 2], frame["elbow current"])


def test_angles_in_degrees_leave_lengths_alone(three: Path) -> None:
    arm, frame = Arm.read(three / "arm.toml"), motion()
    degrees = frame.with_columns(pl.col(f"{joint}/position") * (180 / np.pi) for joint in JOINTS[1:])
    log = Log.from_frame(degrees, arm=arm, units={"q": "deg"})
    np.testing.assert_allclose(log.q, Log.from_frame(frame, arm=arm).q, rtol=1e-14)
    assert [log.units[f"q{j}"] for j in (1, 2, 3)] == ["m", "deg", "deg"]
    recognised = Log.from_frame(degrees, arm=arm)  # by the velocities
    np.testing.assert_allclose(recognised.q, log.q, rtol=1e-14)


#: What is done to a log, further options, and the words of the complaint.
BROKEN_LOGS: list[tuple[str, Callable[[pl.DataFrame], pl.DataFrame], tuple[str, ...], tuple[str, ...]]] = [
    ("an effort is missing", lambda f: f.drop("elbow/effort"), (), ("`elbow/effort`", "mapped to tau3", "missing")),
    ("a position is missing", lambda f: f.drop("shoulder/position"), (), ("`shoulder/position`", "mapped to q2")),
    ("other joints", lambda f: f.rename({c: f"x_{c}" for c in f.columns if "/" in c}), (), ("`q1`", "--columns")),
    ("a word in a column", lambda f: f.with_columns(pl.lit("x").alias("lift/effort")), (), ("`lift/effort`", "row 1")),
    ("a length in mm", lambda f: f.with_columns(pl.col("lift/position") * 1e3), (), ("`lift/position`", "mm")),
    ("mapped to no joint", lambda f: f, ("--columns", "q4=lift/position"), ("`q4`", "3 joints")),
    ("mapped to what is not there", lambda f: f, ("--columns", "q1=lift_position"), ("`lift_position`", "missing")),
    ("mapped twice", lambda f: f, ("--columns", "q1=elbow/position"), ("mapped to both", "`elbow/position`")),
    ("two arms in one log", lambda f: f.rename({c: f"a/{c}" for c in f.columns if "/" in c}).with_columns(
        pl.lit(1.0).alias("b/lift/position")), (), ("`lift/position`", "fits several columns")),
]  # fmt: skip


@pytest.mark.parametrize(("change", "options", "says"), [c[1:] for c in BROKEN_LOGS], ids=[c[0] for c in BROKEN_LOGS])
def test_a_log_that_does_not_fit(
    change: Callable[[pl.DataFrame], pl.DataFrame],
    options: tuple[str, ...],
    says: tuple[str, ...],
    three: Path,
    run: Run,
) -> None:
    change(motion()).write_csv(three / "log.csv")
    refused(run("diagnose", "log.csv", "--arm", "arm.toml", *options), says)


# What serial arms are not taken by


@pytest.mark.parametrize(
    "words",
    [
        ("diagnose", "log.csv", "--arm", "three.urdf"),
        ("replay", "log.csv", "--arm", "arm.toml", "-o", "out.rrd"),
        ("simulate", "--arm", "arm.toml", "--torque", "seed", "-o", "out.csv"),
    ],
    ids=lambda words: words[0],
)
def test_commands_that_take_no_serial_arms(words: tuple[str, ...], three: Path, run: Run) -> None:
    motion().write_csv(three / "log.csv")
    refused(run(*words), ())


def test_a_function_that_takes_no_serial_arms(three: Path) -> None:
    from armgap import fit

    arm = Arm.read(three / "arm.toml")
    log = Log.from_frame(motion(), arm=arm)
    with pytest.raises(ArmgapError, match="serial"):
        fit(log, arm)


def test_a_serial_arm_shows_itself(three: Path) -> None:
    text = Arm.read(three / "arm.toml")._repr_markdown_()
    for words in ("lift, shoulder, elbow", "first moment along x of link 2", "rotor inertia at joint 3", "stand still"):
        assert words in text
    assert "<svg" not in Arm.read(three / "arm.toml")._repr_html_()


def test_whatever_is_damaged_is_refused_in_one_line(three: Path) -> None:
    """A character or a stretch of the file changed or gone: read as some arm, or refused as nothing but a complaint of ours."""
    rng = np.random.default_rng(4)
    refused = 0
    for _ in range(400):
        first = int(rng.integers(len(URDF)))
        last = first + int(rng.choice([1, 1, 5, 40]))
        put = "".join(rng.choice(list('<>"=/ 0.-e${}'), int(rng.integers(0, 4))))
        (three / "three.urdf").write_text(URDF[:first] + put + URDF[last:])
        complaint, arm = _read_or_refused(three / "three.urdf")
        if arm is None:
            refused += 1
            assert "\n" not in str(complaint)
            assert getattr(complaint, "remedy", "")
        else:
            assert np.isfinite(arm.theta).all()
            assert np.isfinite(arm.sigma).all()
            assert (arm.sigma > 0).all()
    assert 100 < refused < 400


def _read_or_refused(path: Path) -> tuple[ArmgapError | None, Arm | None]:
    try:
        return None, read_model(path, tip="flange")
    except ArmgapError as error:
        return error, None
