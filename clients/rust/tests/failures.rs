//! What goes wrong, against the real server.

mod live;

use std::panic::{catch_unwind, AssertUnwindSafe};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use live::{counts, expected, meshed, RestartingServer, Spoilt};
use stellate::manifolds::{ProductOfCircles, Torus};
use stellate::{Client, ClientOptions, Connection, Credentials, Kind};
use stellate::{MeshOptions, Oracle, RunOptions, Server, ServerOptions, WorkerOptions};

#[test]
fn refusals() {
    let server = Server::start(&ServerOptions::default()).unwrap();
    let client = Client::of(&server, ClientOptions::default()).unwrap();
    let options = RunOptions { connection: Connection::Client(&client), ..Default::default() };
    let error = stellate::mesh(&Torus::default(), -1.0, options).unwrap_err();
    assert_eq!((error.kind, &error.reason[..]), (Kind::InvalidArgument, "INVALID_ARGUMENT"));
    assert!(error.message.contains("epsilon") && error.fields.len() == 1, "{error:?}");
    let nobody = format!("meshes/{}", "0".repeat(32));
    assert_eq!(client.get(&nobody).unwrap_err().kind, Kind::MeshNotFound);
    let served = client.serve(&Torus::default(), &nobody, &WorkerOptions::default());
    assert_eq!(served.unwrap_err().kind, Kind::MeshNotFound);

    // A worker of another manifold leaves the mesh alone.
    let info = client.create(&Torus::default(), 0.1, &MeshOptions::default()).unwrap();
    let other = client.serve(&ProductOfCircles { k: 2 }, &info.name, &WorkerOptions::default());
    assert_eq!(other.unwrap_err().kind, Kind::InvalidArgument);
    let right = client.serve(&Torus::default(), &info.name, &WorkerOptions::default());
    assert_eq!(right.unwrap(), "SUCCEEDED");
}

#[test]
fn oracles_that_fail() {
    let server = Server::start(&ServerOptions::default()).unwrap();
    let client = Client::of(&server, ClientOptions::default()).unwrap();
    let meshed = |oracle: &dyn Oracle| meshed(oracle, Connection::Client(&client)).unwrap_err();

    let error = meshed(&Spoilt::new(|_| Err(std::io::Error::other("no such surface").into())));
    assert_eq!(error.kind, Kind::Raised);
    let source = std::error::Error::source(&error).unwrap();
    assert_eq!(source.downcast_ref::<std::io::Error>().unwrap().to_string(), "no such surface");

    let error = meshed(&Spoilt::new(|points| {
        points[0] = f64::NAN;
        Ok(())
    }));
    assert_eq!((error.kind, &error.reason[..]), (Kind::Oracle, "ORACLE_NOT_FINITE"));

    let error = meshed(&Spoilt::new(|points| {
        points.iter_mut().for_each(|value| *value *= 1.1);
        Ok(())
    }));
    assert_eq!((error.kind, &error.reason[..]), (Kind::Oracle, "ORACLE_BAD_TANGENT"));
}

#[test]
fn a_panic_of_an_oracle_is_its_callers() {
    let server = Server::start(&ServerOptions::default()).unwrap();
    let client = Client::of(&server, ClientOptions::default()).unwrap();
    let oracle = Spoilt::new(|_| panic!("no such surface"));
    let meshing = || meshed(&oracle, Connection::Client(&client)).map(|_| ());
    let payload = catch_unwind(AssertUnwindSafe(meshing)).unwrap_err();
    assert_eq!(*payload.downcast_ref::<&str>().unwrap(), "no such surface");
    assert!(client.list().unwrap().is_empty(), "the mesh is gone");
    meshed(&Torus::default(), Connection::Client(&client)).unwrap(); // all else goes on
}

#[test]
fn a_server_that_comes_back_is_waited_for() {
    let server = Mutex::new(RestartingServer::start(&[]));
    let address = server.lock().unwrap().address.clone();
    let said = Arc::new(Mutex::new(Vec::new()));
    let heard = Arc::clone(&said);
    let options = ClientOptions {
        on_outage: Box::new(move |line| heard.lock().unwrap().push(line.to_string())),
        ..Default::default()
    };
    let kills = AtomicUsize::new(0);
    let oracle = Spoilt::new(|_| {
        if kills.fetch_add(1, Ordering::Relaxed) == 0 {
            server.lock().unwrap().restart();
        }
        Ok(())
    });
    let mesh = meshed(&oracle, Connection::Server(&address, options)).unwrap();
    assert_eq!(counts(&mesh), expected()[0]);
    assert!(mesh.certified());
    for words in ["lost the server", "the server is back"] {
        assert!(said.lock().unwrap().iter().any(|line| line.starts_with(words)), "{said:?}");
    }
    drop(server);
    let gone = meshed(&Torus::default(), Connection::Server(&address, ClientOptions::default()));
    assert_eq!(gone.unwrap_err().kind, Kind::Unavailable);
}

#[test]
fn a_reply_that_is_lost_costs_nothing() {
    let server = RestartingServer::lossy();
    // A client each: its first call may be the one whose reply is lost.
    let client = || {
        let options = ClientOptions { reconnect: Duration::ZERO, ..Default::default() };
        Client::new(&server.address, options).unwrap()
    };
    let make = |_| client().create(&Torus::default(), 0.2, &MeshOptions::default()).unwrap().name;
    let mut names: Vec<String> = (0..6).map(make).collect();
    names.sort();
    let listed = || client().list().unwrap().into_iter().map(|mesh| mesh.name);
    let mut there: Vec<String> = listed().collect();
    there.sort();
    assert_eq!(there, names, "each once");
    names.iter().for_each(|name| client().delete(name).unwrap());
    assert_eq!(listed().count(), 0);
}

#[test]
fn tls_and_a_token() {
    let pem = live::secret("proxy.pem").display().to_string();
    let tokens = live::secret("tokens").display().to_string();
    let server = RestartingServer::start(&["--tls-cert", &pem, "--tls-key", &pem, "--token-file", &tokens]);
    let address = server.address.replace("127.0.0.1", "localhost");
    let token = std::fs::read_to_string(live::secret("me.token")).unwrap().trim().to_string();
    let ca = Some(live::secret("ca.pem"));
    let ask = |credentials| {
        let options = ClientOptions { credentials, ..Default::default() };
        meshed(&Torus::default(), Connection::Server(&address, options))
    };
    let right = Credentials { ca: ca.clone(), token: Some(token.clone()), ..Default::default() };
    assert!(ask(right).unwrap().certified());
    let none = Credentials { ca: ca.clone(), ..Default::default() };
    let refused = ask(none).unwrap_err();
    assert_eq!(refused.kind, Kind::Unauthenticated);
    assert!(refused.message.contains("give a token"), "{refused:?}");
    let guessed = Credentials { ca, token: Some("guessed".to_string()), ..Default::default() };
    assert_eq!(ask(guessed).unwrap_err().kind, Kind::Unauthenticated);
    let stranger = Credentials { tls: true, token: Some(token.clone()), ..Default::default() };
    assert_eq!(ask(stranger).unwrap_err().kind, Kind::Unavailable);
    let credentials = Credentials { token: Some(token), ..Default::default() };
    let plain = Client::new("mesh.example.org:7717", ClientOptions { credentials, ..Default::default() });
    assert_eq!(plain.err().unwrap().kind, Kind::InvalidArgument);
}
