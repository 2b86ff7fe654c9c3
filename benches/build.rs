//! Compiles the plain C baselines of `baselines` twice: for any processor, and for this machine's.

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
}
