//! For every line "EPSILON" on standard input meshes the torus on the server that it is given, and prints
//! "SECONDS VERTICES SIMPLICES".

use std::io::BufRead;
use std::time::Instant;

use stellate::manifolds::Torus;
use stellate::{BoxError, Client, ClientOptions, Connection, RunOptions};

fn main() -> Result<(), BoxError> {
    let server = std::env::args().nth(1).ok_or("name the server")?;
    let client = Client::new(&server, ClientOptions::default())?;
    for line in std::io::stdin().lock().lines() {
        let begin = Instant::now();
        let options = RunOptions { connection: Connection::Client(&client), ..Default::default() };
        let mesh = stellate::mesh(&Torus::default(), line?.trim().parse()?, options)?;
        let seconds = begin.elapsed().as_secs_f64();
        println!("{seconds} {} {}", mesh.vertex_count(), mesh.simplex_count());
    }
    Ok(())
}
