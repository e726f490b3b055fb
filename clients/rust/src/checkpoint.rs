//! A directory in which one mesh outlives the processes that make it: clients/shared/checkpoint.toml.

use std::fs;
use std::io::{self, Read, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::thread;
use std::time::{Duration, Instant};

use prost::Message;

use crate::client::Client;
use crate::error::{Error, Kind};
use crate::proto::{Mesh as MeshInfo, MeshSpec};
use crate::server::{Server, ServerOptions};
use crate::shared::checkpoint as layout;

pub struct Checkpoint<'a>(pub &'a Path);

impl Checkpoint<'_> {
    fn record(&self) -> PathBuf {
        self.0.join(layout::RECORD)
    }

    fn wrong(&self, what: &str) -> Error {
        Error::invalid(format!("the checkpoint {} {what}", self.0.display()))
    }

    /// Starts the private server, once that of a killed process has come to its end.
    pub fn server(&self) -> Result<Server, Error> {
        let made = fs::DirBuilder::new().recursive(true).mode(0o700).create(self.0);
        made.map_err(|error| self.wrong(&format!("cannot be made: {error}")))?;
        self.insist_on_own()?;
        if self.0.join(layout::PYTHON_RECORD).exists() {
            return Err(self.wrong("is of the Python client: take another directory"));
        }
        let data = self.0.join(layout::SERVER).display().to_string();
        let kept = layout::KEEP_FINISHED_SECONDS.to_string();
        let flags = ["--data-dir", &data, "--keep-finished-seconds", &kept].map(String::from);
        let options = ServerOptions { flags: flags.to_vec(), ..Default::default() };
        let begin = Instant::now();
        loop {
            match Server::start(&options) {
                Err(error) if error.message.contains("another server uses") => {
                    if begin.elapsed().as_secs_f64() > layout::LAST_SERVER_SECONDS {
                        let message = format!(
                            "another process is meshing in the checkpoint {}: wait for its end, or take \
                             another directory",
                            self.0.display()
                        );
                        return Err(Error::new(Kind::FailedPrecondition, "FAILED_PRECONDITION", message));
                    }
                    thread::sleep(Duration::from_millis(100));
                }
                started => return started,
            }
        }
    }

    /// Fails where others could have put there what we would believe.
    fn insist_on_own(&self) -> Result<(), Error> {
        // Without a last slash, by which a link would be followed.
        let path: PathBuf = self.0.components().collect();
        let found = fs::symlink_metadata(path);
        let found = found.map_err(|error| self.wrong(&format!("cannot be used: {error}")))?;
        if found.file_type().is_symlink() {
            return Err(self.wrong("is a link: name the directory that it leads to"));
        }
        if found.uid() != self.own_user()? {
            return Err(self.wrong("belongs to another user: take another directory"));
        }
        if found.mode() & 0o022 != 0 {
            return Err(self.wrong(&format!(
                "may be written by others (mode {:04o}): take another directory, or, if all in it is yours, \
                 chmod go-w",
                found.mode() & 0o7777
            )));
        }
        Ok(())
    }

    fn own_user(&self) -> Result<u32, Error> {
        let process = fs::metadata("/proc/self");
        Ok(process.map_err(|error| self.wrong(&format!("cannot be used: {error}")))?.uid())
    }

    /// The record, if it is a file of this user's and no link; empty if there is none.
    fn read_own(&self) -> Result<Vec<u8>, Error> {
        let wrong = |error: io::Error| self.wrong(&format!("cannot be used: {error}"));
        let found = match fs::symlink_metadata(self.record()) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            found => found.map_err(wrong)?,
        };
        if !found.file_type().is_file() || found.uid() != self.own_user()? {
            return Err(self
                .wrong("has a record that is a link, or no file of this user's: take another directory"));
        }
        let mut kept = Vec::new();
        let mut file = fs::File::open(self.record()).map_err(wrong)?;
        file.read_to_end(&mut kept).map_err(wrong)?;
        Ok(kept)
    }

    /// The mesh that is there, or a new one.
    pub fn declare(&self, client: &Client, spec: MeshSpec) -> Result<MeshInfo, Error> {
        let wanted = MeshSpec { label: String::new(), ..spec.clone() };
        let unreadable = |error: io::Error| self.wrong(&format!("cannot be used: {error}"));
        let kept = self.read_own()?;
        let mut parts = kept.splitn(2, |&byte| byte == b'\n');
        let first = parts.next().unwrap_or_default();
        // What may follow the name is of clients that choose epsilon.
        let name = first.split(|&byte| byte == b' ').next().unwrap_or_default();
        let same = |bytes| MeshSpec::decode(bytes).is_ok_and(|there: MeshSpec| there == wanted);
        if !name.is_empty() && !parts.next().is_some_and(same) {
            return Err(
                self.wrong("is of a mesh of another specification: take another directory, or remove it")
            );
        }
        let mut found = None;
        for info in client.list()? {
            if info.name.as_bytes() == name {
                found = Some(info);
            } else {
                client.delete(&info.name)?; // was forgotten, or never put down
            }
        }
        if let Some(info) = found {
            return Ok(info);
        }
        let info = client.create_from(spec)?;
        let draft = self.0.join(layout::DRAFT); // all of it or nothing
        let record = [info.name.as_bytes(), b"\n", &wanted.encode_to_vec()].concat();
        let write = || {
            match fs::remove_file(&draft) {
                Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
                _ => {} // of a process that was killed; a link itself, not where it leads
            }
            let mut file = fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(&draft)?;
            file.write_all(&record)?;
            fs::rename(&draft, self.record())
        };
        write().map_err(unreadable)?;
        Ok(info)
    }

    /// Has the next call begin from the start where this mesh has failed for good.
    pub fn forget_after(&self, error: &Error) {
        let over = error.mesh.as_ref().is_some_and(|mesh| mesh.report.is_some());
        if over && !error.reason.starts_with("JOURNAL_") {
            let _ = fs::remove_file(self.record()); // with more room for its journal it would go on
        }
    }
}
