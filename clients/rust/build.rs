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

/// A module of the numbers of retries.json, a service config of gRPC, which tonic does not take: "0.1s" is 0.1.
fn retries() -> std::io::Result<String> {
    let path = format!("{}/retries.json", within("shared", "../shared"));
    println!("cargo:rerun-if-changed={path}");
    let text = std::fs::read_to_string(&path)?;
    let mut module = String::from("pub mod retries {\n");
    for (key, name) in [
        ("maxAttempts", "MAX_ATTEMPTS"),
        ("initialBackoff", "INITIAL_BACKOFF"),
        ("maxBackoff", "MAX_BACKOFF"),
        ("backoffMultiplier", "BACKOFF_MULTIPLIER"),
    ] {
        let parts: Vec<&str> = text.split(&format!("\"{key}\":")).collect();
        assert_eq!(parts.len(), 2, "{path}: one policy, with one {key}");
        let value = parts[1].split([',', '}']).next().unwrap_or_default();
        let number = value.trim().trim_matches('"').trim_end_matches('s').parse::<f64>();
        let number = number.unwrap_or_else(|error| panic!("{path}: {key}: {error}"));
        writeln!(module, "pub const {name}: f64 = {number:?};").expect("a string takes it");
    }
    Ok(module + "}\n")
}

fn main() -> std::io::Result<()> {
    let shared = constants("reconnect")? + &constants("checkpoint")? + &retries()?;
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
