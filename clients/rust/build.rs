//! Generates the protocol's code from the protocol's own files. Needs protoc.

fn main() -> std::io::Result<()> {
    let protos = "../../proto";
    let files = ["v1/stellate", "v1/doctor", "v1/errors", "rpc/status_details"]
        .map(|file| format!("{protos}/stellate/{file}.proto"));
    println!("cargo:rerun-if-changed={protos}");
    tonic_prost_build::configure()
        .build_server(false)
        .build_transport(false)
        .compile_protos(&files, &[protos.to_string()])
}
