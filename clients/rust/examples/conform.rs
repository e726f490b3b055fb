//! Obeys tests/languages/conform.py: see there.

use std::io::BufRead;

use stellate::manifolds::Torus;
use stellate::proto::{CertificateLevel, Termination};
use stellate::{BoxError, Client, ClientOptions, Connection, Error, Growth, Kind, Mesh, MeshOptions};

fn obey(client: &Client, words: &[&str]) -> Result<Option<Mesh>, Error> {
    if words[0] == "create" {
        let options = MeshOptions { label: words[1].to_string(), ..Default::default() };
        client.create(&Torus::default(), 1.0, &options)?;
        return Ok(None);
    }
    if words[0] == "save" {
        Mesh::load_txt(words[1])?.save(words[2])?;
        return Ok(None);
    }
    let mut last = None;
    stellate::watch_by_name(words[1], Connection::Client(client), |mesh| {
        last = Some(mesh);
        Growth::GoOn
    })?;
    Ok(last)
}

/// An enumerator without its prefix, or UNKNOWN, which a newer server's is.
fn name<E: TryFrom<i32>>(value: i32, words: impl Fn(&E) -> &'static str, prefix: &str) -> String {
    E::try_from(value).map_or("UNKNOWN", |known| words(&known)).trim_start_matches(prefix).to_string()
}

fn main() -> Result<(), BoxError> {
    let server = std::env::args().nth(1).ok_or("name the server")?;
    let options = ClientOptions { on_outage: Box::new(|_| {}), ..Default::default() };
    let client = Client::new(&server, options)?;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split(' ').collect();
        let mesh = match obey(&client, &words) {
            Ok(Some(mesh)) => mesh,
            Ok(None) => {
                println!("saved");
                continue;
            }
            Err(Error { kind: Kind::Cancelled, mesh: Some(mesh), .. }) => *mesh,
            Err(error) => {
                println!("error {:?} {}", error.kind, error.reason);
                continue;
            }
        };
        mesh.save(words[2])?;
        let report = mesh.report.unwrap_or_default();
        let level = report.certificate.as_ref().map_or(0, |proved| proved.level);
        let ended = name(report.termination, Termination::as_str_name, "TERMINATION_");
        let level = name(level, CertificateLevel::as_str_name, "CERTIFICATE_LEVEL_");
        println!("mesh {} {ended} {level}", mesh.revision);
    }
    Ok(())
}
