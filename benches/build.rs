//! Compiles the plain C estimator twice: portable, and for this machine's processor.

fn main() {
    println!("cargo:rerun-if-changed=peers");
    cc::Build::new().file("peers/online.c").opt_level(3).warnings(true).compile("peer");
    let mut native = cc::Build::new();
    native.file("peers/online.c").opt_level(3).flag("-march=native");
    for name in ["peer_start", "peer_update", "peer_run", "peer_size"] {
        native.define(name, format!("{name}_native").as_str());
    }
    native.compile("peer_native");
}
