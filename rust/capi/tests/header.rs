//! Test that the committed header `armgap.h` is what cbindgen makes of the sources.

use std::path::Path;

#[test]
fn the_header_is_current() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).expect("cbindgen.toml");
    let mut made = Vec::new();
    cbindgen::Builder::new()
        .with_config(config)
        .with_src(folder.join("src/settings.rs"))
        .with_src(folder.join("src/double.rs"))
        .with_src(folder.join("src/single.rs"))
        .with_src(folder.join("src/simulate.rs"))
        .with_src(folder.join("src/chain.rs"))
        .with_src(folder.join("src/chain_single.rs"))
        .generate()
        .expect("a header")
        .write(&mut made);
    let made = String::from_utf8(made).expect("text");
    let file = folder.join("include/armgap.h");
    if std::env::var_os("ARMGAP_WRITE_HEADER").is_some() {
        std::fs::write(&file, &made).expect("writable");
    }
    let committed = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(committed == made, "include/armgap.h is not what the sources give: run `make header`");
}
