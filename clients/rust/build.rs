//! Generates the protocol's code from the protocol's own files. Needs protoc.

fn main() -> std::io::Result<()> {
    let protos = "../../proto";
    let files =
        ["stellate/v1/stellate.proto", "stellate/v1/errors.proto", "stellate/rpc/status_details.proto"]
            .map(|file| format!("{protos}/{file}"));
    println!("cargo:rerun-if-changed={protos}");
    tonic_prost_build::configure()
        .build_server(false)
        .build_transport(false)
        .compile_protos(&files, &[protos.to_string()])
}
