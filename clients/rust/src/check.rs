//! Whether an oracle is what it should be, and how large epsilon may be: the server asks the questions,
//! for clients in all languages alike.

use crate::client::{Client, ClientOptions};
use crate::error::{Error, Kind};
use crate::oracle::{Checked, Oracle};
use crate::proto::examine_response::Event;
use crate::proto::{CheckReport, ExamineRequest};
use crate::server::{Server, ServerOptions};
use crate::spec::MeshOptions;
use crate::worker::WorkerOptions;

/// Probes an oracle for its contract, before a mesh is made of its answers; what it fails with is a
/// finding, too. `epsilon`: that a mesh is planned with. A private server asks; see `Client::check`
/// for another.
pub fn check(oracle: &dyn Oracle, epsilon: Option<f64>) -> Result<CheckReport, Error> {
    let server = Server::start(&ServerOptions::default())?;
    Client::of(&server, ClientOptions::default())?.check(oracle, epsilon)
}

impl Client {
    /// Has this server examine an oracle: see the function `check`.
    pub fn check(&self, oracle: &dyn Oracle, epsilon: Option<f64>) -> Result<CheckReport, Error> {
        let spec = self.spec(&Checked::new(oracle)?, epsilon.unwrap_or(0.0), &MeshOptions::default());
        let request = ExamineRequest { spec: Some(spec), ..Default::default() };
        let mut stub = self.stub.clone();
        let opened = self.runtime.block_on(stub.examine(request));
        let mut events = opened.map_err(|status| Error::from_status(&status))?.into_inner();
        let mut failure = None;
        loop {
            match self.runtime.block_on(events.message()) {
                Ok(Some(response)) => match response.event {
                    Some(Event::Mesh(mesh)) => {
                        failure = self.serve(oracle, &mesh.name, &WorkerOptions::default()).err();
                    }
                    Some(Event::Report(report)) => return Ok(report),
                    _ => {}
                },
                Ok(None) => return Err(Error::protocol("it ended an examination without a report")),
                // There was no examination.
                Err(status) => return Err(failure.unwrap_or_else(|| Error::from_status(&status))),
            }
        }
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
