//! Tests of the C interface from C programs: compiled as C and as C++, with sanitizers, and under valgrind.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Largest relative error of an estimate of the C example; its encoders are exact, so the error is that of sampled torques.
const ACCURACY: f64 = 0.01;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Path of the static library that cargo built with the tests of the C interface.
fn library() -> PathBuf {
    let folder = std::env::current_exe().expect("a path").parent().expect("a folder").to_path_buf();
    let built =
        std::fs::read_dir(&folder).expect("readable").filter_map(Result::ok).map(|entry| entry.path());
    let name = |path: &Path| path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    built
        .filter(|path| name(path).starts_with("libarmgap") && path.extension().is_some_and(|e| e == "a"))
        .filter(|path| !name(path).contains("embed"))
        .max_by_key(|path| path.metadata().and_then(|m| m.modified()).ok())
        .expect("the static library beside the tests")
}

fn installed(tool: &str) -> bool {
    Command::new(tool).arg("--version").output().is_ok_and(|output| output.status.success())
}

fn text(output: &Output) -> String {
    format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr))
}

/// Compiles a C source with all warnings as errors; returns the compiler's message if it fails.
fn compile(compiler: &str, source: &Path, program: &Path, more: &[&str]) -> Result<(), String> {
    let mut command = Command::new(compiler);
    command.args(["-O2", "-g", "-Wall", "-Wextra", "-Werror"]).args(more);
    command.arg("-I").arg(here("include")).arg(source);
    if compiler == "c++" {
        // What follows the source is no C++.
        command.args(["-x", "none"]);
    }
    command.arg(library()).args(["-lm", "-lpthread", "-ldl", "-o"]).arg(program);
    let output = command.output().map_err(|e| e.to_string())?;
    if output.status.success() { Ok(()) } else { Err(text(&output)) }
}

fn built(compiler: &str, source: &str, more: &[&str]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("program");
    compile(compiler, &here(source), &program, more).unwrap_or_else(|message| panic!("{message}"));
    (folder, program)
}

fn runs(program: &mut Command) -> String {
    let output = program.output().expect("started");
    assert!(output.status.success(), "{}", text(&output));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

const CONTROLLER: &str = "../../examples/controller/controller.c";
const ABI: &str = "tests/abi.c";
const CHAIN: &str = "tests/chain.c";
const C11: &[&str] = &["-std=c11"];

fn is_accurate(printed: &str) {
    let numbers = |line: &str| -> Vec<f64> {
        line.split(|c: char| !(c.is_ascii_digit() || ".-+e".contains(c)))
            .filter_map(|w| w.parse().ok())
            .collect()
    };
    let rows: Vec<Vec<f64>> = printed.lines().take(9).map(numbers).collect();
    assert_eq!(rows.len(), 9, "{printed}");
    for row in rows {
        let (estimate, truth) = (row[1], row[row.len() - 1]);
        assert!((estimate / truth - 1.0).abs() < ACCURACY, "{printed}");
    }
    assert!(printed.contains("updates 3998 rejected 0"), "{printed}");
}

#[test]
fn the_example_identifies_its_arm_in_c() {
    let (_folder, program) = built("cc", CONTROLLER, C11);
    is_accurate(&runs(&mut Command::new(program)));
}

#[test]
fn the_example_is_cpp_too() {
    if !installed("c++") {
        eprintln!("skipped: c++ is not installed");
        return;
    }
    let (_folder, program) = built("c++", CONTROLLER, &["-std=c++17", "-x", "c++"]);
    is_accurate(&runs(&mut Command::new(program)));
}

#[test]
fn every_bad_call_is_answered() {
    for source in [ABI, CHAIN] {
        let (_folder, program) = built("cc", source, C11);
        runs(&mut Command::new(program));
    }
}

#[test]
fn sanitizers_find_nothing() {
    let flags = ["-std=c11", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"];
    let folder = tempfile::tempdir().expect("a folder");
    let trivial = folder.path().join("trivial.c");
    std::fs::write(&trivial, "int main(void) { return 0; }\n").expect("writable");
    if let Err(message) = compile("cc", &trivial, &folder.path().join("trivial"), &flags) {
        let line = message.lines().next().unwrap_or_default();
        eprintln!("skipped: cc has no address and undefined-behaviour sanitizers ({line})");
        return;
    }
    for source in [ABI, CHAIN, CONTROLLER] {
        let (_folder, program) = built("cc", source, &flags);
        runs(&mut Command::new(program));
    }
}

#[test]
fn valgrind_finds_nothing() {
    if !installed("valgrind") {
        eprintln!("skipped: valgrind is not installed");
        return;
    }
    for source in [ABI, CHAIN, CONTROLLER] {
        let (_folder, program) = built("cc", source, C11);
        let mut command = Command::new("valgrind");
        runs(
            command
                .args(["-q", "--error-exitcode=9", "--leak-check=full", "--track-origins=yes"])
                .arg(program),
        );
    }
}
