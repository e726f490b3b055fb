//! Generates the protocol's code from the protocol's own files, and constants from the tables that all
//! clients share. Needs protoc.

use std::fmt::Write;

/// A folder as it is in the package, or else in the source tree.
fn within(package: &'static str, tree: &'static str) -> &'static str {
    if std::path::Path::new(package).is_dir() {
        package
    } else {
        tree
    }
}

/// A module of constants: first_pause = 0.1 becomes FIRST_PAUSE. All numbers are f64.
fn constants(name: &str) -> std::io::Result<String> {
    let path = format!("{}/{name}.toml", within("shared", "../shared"));
    println!("cargo:rerun-if-changed={path}");
    let mut module = format!("pub mod {name} {{\n");
    for line in std::fs::read_to_string(path)?.lines() {
        let line = line.split('#').next().unwrap_or_default();
        let Some((key, value)) = line.split_once('=') else { continue };
        let (key, value) = (key.trim().to_uppercase(), value.trim());
        let (kind, value) = match value.parse::<f64>() {
            Ok(number) => ("f64", format!("{number:?}")),
            Err(_) => ("&str", value.to_string()),
        };
        writeln!(module, "pub const {key}: {kind} = {value};").expect("a string takes it");
    }
    Ok(module + "}\n")
}

fn main() -> std::io::Result<()> {
    let shared = constants("reconnect")? + &constants("checkpoint")?;
    let folder = std::env::var("OUT_DIR").expect("cargo sets it");
    std::fs::write(format!("{folder}/shared.rs"), shared)?;
    let protos = within("proto", "../../proto");
    let files = ["v1/stellate", "v1/doctor", "v1/errors", "rpc/status_details"]
        .map(|file| format!("{protos}/stellate/{file}.proto"));
    println!("cargo:rerun-if-changed={protos}");
    tonic_prost_build::configure()
        .build_server(false)
        .build_transport(false)
        .compile_protos(&files, &[protos.to_string()])
}
