//! The doctor: whether an oracle is what it should be, and how large epsilon may be. The program
//! `stellate` asks the questions, for clients in all languages alike.

use crate::client::{Client, ClientOptions};
use crate::error::{Error, Kind};
use crate::oracle::Oracle;
use crate::proto::doctor_client::DoctorClient;
use crate::proto::{CheckReport, GetCheckReportRequest};
use crate::server::Server;
use crate::spec::MeshOptions;
use crate::worker::WorkerOptions;

/// Probes an oracle for its contract, before a mesh is made of its answers; what it fails with is a
/// finding, too. `epsilon`: that a mesh is planned with.
pub fn check(oracle: &dyn Oracle, epsilon: Option<f64>) -> Result<CheckReport, Error> {
    let doctor = Server::start_doctor()?;
    let client = Client::of(&doctor, ClientOptions::default())?;
    let name = client.create(oracle, epsilon.unwrap_or(0.0), &MeshOptions::default())?.name;
    let served = client.serve(oracle, &name, &WorkerOptions::default());
    let mut stub = DoctorClient::new(client.channel.clone());
    let report = client
        .runtime
        .block_on(stub.get_check_report(GetCheckReportRequest { name, ..Default::default() }));
    match (report, served) {
        (Ok(report), _) => Ok(report.into_inner()),
        (Err(_), Err(failure)) => Err(failure), // there was no examination
        (Err(status), Ok(_)) => Err(Error::from_status(&status)),
    }
}

/// A quarter of the reach that `check` finds, to two digits, and a word about it. An error of kind
/// `Oracle` where the oracle breaks its contract.
pub fn choose_epsilon(oracle: &dyn Oracle) -> Result<(f64, String), Error> {
    let report = check(oracle, None)?;
    if let Some(epsilon) = report.epsilon {
        return Ok((epsilon, report.epsilon_reason));
    }
    let problem = report.no_epsilon.unwrap_or_default();
    Err(Error::new(Kind::Oracle, &problem.reason, problem.message))
}
