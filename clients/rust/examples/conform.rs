//! Obeys `stellate conform`, whose help says what each line wants.

use std::io::BufRead;

use stellate::manifolds::Torus;
use stellate::proto::{CertificateLevel, Termination};
use stellate::{
    reconstruct, BoxError, Capabilities, Client, ClientOptions, Connection, Credentials, Error, Growth,
    Kind, Mesh, MeshOptions, Oracle, PointCloud, ReconstructOptions,
};

use manifolds::manifold;

#[path = "conform/manifolds.rs"]
mod manifolds;

fn connect(server: &str, token: Option<&str>) -> Result<Client, Error> {
    let credentials = Credentials { token: token.map(String::from), ..Default::default() };
    Client::new(server, ClientOptions { credentials, on_outage: Box::new(|_| {}), ..Default::default() })
}

/// An enumerator without its prefix, or UNKNOWN, which a newer server's is.
fn name<E: TryFrom<i32>>(value: i32, words: impl Fn(&E) -> &'static str, prefix: &str) -> String {
    E::try_from(value).map_or("UNKNOWN", |known| words(&known)).trim_start_matches(prefix).to_string()
}

fn watch(client: &Client, mesh: &str, path: &str) -> Result<String, Error> {
    let mut last = None;
    let ended = stellate::watch_by_name(mesh, Connection::Client(client), |mesh| {
        last = Some(mesh);
        Growth::GoOn
    });
    let mesh = match ended {
        Err(Error { kind: Kind::Cancelled, mesh: Some(mesh), .. }) => *mesh,
        other => other.map(|()| last.expect("a mesh"))?,
    };
    mesh.save(path)?;
    if !mesh.walls.is_empty() {
        let lines: String = mesh.walls.iter().map(|bits| format!("{bits}\n")).collect();
        std::fs::write(format!("{path}.walls"), lines).expect("a folder of the kit's");
    }
    Ok(format!("mesh {} {}", mesh.revision, how_it_ended(&mesh)))
}

fn how_it_ended(mesh: &Mesh) -> String {
    let report = mesh.report.clone().unwrap_or_default();
    let level = report.certificate.as_ref().map_or(0, |proved| proved.level);
    let ended = name(report.termination, Termination::as_str_name, "TERMINATION_");
    let level = name(level, CertificateLevel::as_str_name, "CERTIFICATE_LEVEL_");
    format!("{ended} {level}")
}

fn from_points(client: &Client, path: &str, dimensions: &[&str]) -> Result<String, Error> {
    let text = std::fs::read_to_string(path).expect("a file of the kit's");
    let points: Vec<f64> =
        text.split_whitespace().map(|word| word.parse().expect("numbers of the kit's")).collect();
    let [dimension, ambient_dimension] = [0, 1].map(|i| dimensions[i].parse().expect("a dimension"));
    let cloud = PointCloud { dimension, ambient_dimension, points: &points, tangents: None };
    let options = ReconstructOptions { connection: Connection::Client(client), ..Default::default() };
    Ok(format!("mesh - {}", how_it_ended(&reconstruct(cloud, options)?)))
}

/// The torus, with a seed in place of its box.
struct Seeded(Torus);

impl Oracle for Seeded {
    fn dimension(&self) -> usize {
        self.0.dimension()
    }
    fn ambient_dimension(&self) -> usize {
        self.0.ambient_dimension()
    }
    fn capabilities(&self) -> Capabilities {
        self.0.capabilities()
    }
    fn seeds(&self) -> Option<Vec<f64>> {
        Some(vec![1.4, 0.0, 0.0])
    }
    fn closest_point(&self, x: &[f64], points: &mut [f64], found: &mut [bool]) -> Result<(), BoxError> {
        self.0.closest_point(x, points, found)
    }
}

fn create(server: &str, label: &str, how: &str) -> Result<String, Error> {
    let client = connect(server, how.strip_prefix("token="))?;
    let oracle: Box<dyn Oracle> = match how {
        "seeds" => Box::new(Seeded(Torus::default())),
        "walls" => manifold("lune").expect("a manifold of the kit's"),
        _ => Box::new(Torus::default()),
    };
    let options = MeshOptions { label: label.to_string(), ..Default::default() };
    Ok(format!("created {}", client.create(oracle.as_ref(), 0.5, &options)?.name))
}

fn obey(server: &str, client: &Client, words: &[&str]) -> Result<String, Error> {
    let (what, more) = (words.get(1).unwrap_or(&""), words.get(2).unwrap_or(&""));
    match words[0] {
        "create" => create(server, what, more),
        "watch" => watch(client, what, more),
        "reconstruct" => from_points(client, what, &words[2..]),
        "save" => Mesh::load_txt(what)?.save(more).map(|()| "saved".to_string()),
        "serve" => match manifold(more) {
            Some(oracle) => {
                Ok(format!("over {}", client.serve(oracle.as_ref(), what, &Default::default())?))
            }
            None => Ok("unsupported".to_string()),
        },
        _ => Ok("unsupported".to_string()),
    }
}

fn main() -> Result<(), BoxError> {
    let server = std::env::args().nth(1).ok_or("name the server")?;
    let client = connect(&server, None)?;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split(' ').collect();
        println!(
            "{}",
            obey(&server, &client, &words).unwrap_or_else(|error| {
                let words = error.message.replace('\n', " ");
                format!("error {:?} {} {words}", error.kind, error.reason)
            })
        );
    }
    Ok(())
}
