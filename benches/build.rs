//! Compiles the plain C of `peers` twice: portable, and for this machine's processor.

const FUNCTIONS: [&str; 6] =
    ["peer_start", "peer_update", "peer_run", "peer_size", "peer_rollout", "peer_rollout_smooth"];

fn main() {
    println!("cargo:rerun-if-changed=peers");
    let files = ["peers/online.c", "peers/rollout.c"];
    cc::Build::new().files(files).opt_level(3).warnings(true).compile("peer");
    let mut native = cc::Build::new();
    native.files(files).opt_level(3).flag("-march=native");
    for name in FUNCTIONS {
        native.define(name, format!("{name}_native").as_str());
    }
    native.compile("peer_native");
}
