//! Compiles the plain C baselines of `baselines` twice: for any processor, and for this machine's; with the feature `pinocchio` also Pinocchio's
//! algorithms in C++, for the processor that the Rust code is compiled for.

use std::path::{Path, PathBuf};
use std::process::Command;

const FUNCTIONS: [&str; 9] = [
    "baseline_start",
    "baseline_update",
    "baseline_run",
    "baseline_size",
    "baseline_rollout",
    "baseline_rollout_smooth",
    "chain_start",
    "chain_run",
    "chain_size",
];

fn main() {
    println!("cargo:rerun-if-changed=baselines");
    let files = ["baselines/online.c", "baselines/online_chain.c", "baselines/rollout.c"];
    cc::Build::new().files(files).opt_level(3).warnings(true).compile("baseline");
    let mut native = cc::Build::new();
    native.files(files).opt_level(3).flag("-march=native");
    for name in FUNCTIONS {
        native.define(name, format!("{name}_native").as_str());
    }
    native.compile("baseline_native");
    println!("cargo:rustc-check-cfg=cfg(pinocchio)");
    match pinocchio() {
        Ok(compiler) => {
            println!("cargo:rustc-cfg=pinocchio");
            println!("cargo:rustc-env=PINOCCHIO_COMPILER={compiler}");
        }
        Err(missing) => println!("cargo:rustc-env=PINOCCHIO_MISSING={missing}"),
    }
}

/// Compiles `baselines/pinocchio.cpp`; returns the compiler and its flags, or in one line what is missing.
fn pinocchio() -> Result<String, String> {
    for name in ["PINOCCHIO_PREFIX", "EIGEN_INCLUDE", "CARGO_FEATURE_PINOCCHIO"] {
        println!("cargo:rerun-if-env-changed={name}");
    }
    if std::env::var_os("CARGO_FEATURE_PINOCCHIO").is_none() {
        return Err("the feature `pinocchio` is off".into());
    }
    let include = prefix().ok_or("no Python with the wheel `pin`; set PINOCCHIO_PREFIX")?.join("include");
    let eigen = std::env::var_os("EIGEN_INCLUDE").map_or_else(|| "/usr/include/eigen3".into(), PathBuf::from);
    for (header, what) in [
        (include.join("pinocchio/config.hpp"), "Pinocchio"),
        (include.join("boost/version.hpp"), "Boost"),
        (eigen.join("Eigen/Core"), "Eigen (EIGEN_INCLUDE)"),
    ] {
        if !header.exists() {
            return Err(format!("no headers of {what}: {} does not exist", header.display()));
        }
    }
    let mut build = cc::Build::new();
    build
        .cpp(true)
        .std("c++17")
        .opt_level(3)
        .warnings(false)
        .file("baselines/pinocchio.cpp")
        .include(&include);
    build.flag("-isystem").flag(&eigen).define("NDEBUG", None);
    // The definitions that Pinocchio's CMake targets have.
    for (name, value) in [
        ("BOOST_MPL_LIMIT_LIST_SIZE", Some("30")),
        ("BOOST_MPL_LIMIT_VECTOR_SIZE", Some("30")),
        ("BOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", None),
        ("BOOST_FUSION_INVOKE_MAX_ARITY", Some("12")),
    ] {
        build.define(name, value);
    }
    let native =
        std::env::var("CARGO_ENCODED_RUSTFLAGS").is_ok_and(|flags| flags.contains("target-cpu=native"));
    if native {
        build.flag("-march=native");
    }
    let compiler = build.try_get_compiler().map_err(|_| "no C++ compiler")?;
    build.try_compile("pinocchio_arm").map_err(|_| "baselines/pinocchio.cpp does not compile")?;
    let version = output(compiler.path(), &["--version"]).ok_or("the C++ compiler does not run")?;
    Ok(format!("{}, -O3{}", version.lines().next().unwrap_or(""), if native { " -march=native" } else { "" }))
}

/// Folder that the wheel `pin` installs headers and libraries in: `PINOCCHIO_PREFIX`, or that of the project's virtual environment or of `python3`.
fn prefix() -> Option<PathBuf> {
    if let Some(prefix) = std::env::var_os("PINOCCHIO_PREFIX") {
        return Some(prefix.into());
    }
    let code = "import sysconfig; print(sysconfig.get_path('purelib'))";
    let of =
        |python: &str| Some(Path::new(output(Path::new(python), &["-c", code])?.trim()).join("cmeel.prefix"));
    ["../.venv/bin/python", "python3"].into_iter().filter_map(of).find(|prefix| prefix.exists())
}

/// What a program writes to its standard output, if it runs.
fn output(program: &Path, arguments: &[&str]) -> Option<String> {
    let output =
        Command::new(program).args(arguments).output().ok().filter(|output| output.status.success())?;
    String::from_utf8(output.stdout).ok()
}
