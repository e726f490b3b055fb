//! A stellated of one's own: found, started, and stopped.

use std::env;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::PermissionsExt;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::error::{Error, Kind};

const STOP_TIME: Duration = Duration::from_secs(10);

/// How a server is started.
#[derive(Clone, Debug, Default)]
pub struct ServerOptions {
    /// The program; by default see `find_stellated`.
    pub binary: Option<PathBuf>,
    /// "host:port"; by default a unix socket that only this user may enter.
    pub listen: Option<String>,
    /// More flags of stellated's, e.g. "--data-dir", "meshes".
    pub flags: Vec<String>,
}

/// A stellated of this process's own, which ends with it whatever happens.
#[derive(Debug)]
pub struct Server {
    pub(crate) address: String,
    pub(crate) private: bool,
    process: Arc<Process>,
}

#[derive(Debug)]
pub(crate) struct Process {
    child: Mutex<Child>,
    words: Arc<Mutex<String>>,
    folder: PathBuf,
}

fn runs(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|about| about.is_file() && about.permissions().mode() & 0o111 != 0)
}

fn on_path(name: &Path) -> Option<PathBuf> {
    let folders = env::var_os("PATH").unwrap_or_default();
    let mut paths = env::split_paths(&folders).map(|folder| folder.join(name));
    paths.find(|path| runs(path))
}

/// The server binary: $STELLATED, else build/ of the source tree, else PATH.
pub fn find_stellated() -> Result<PathBuf, Error> {
    let none = |message: String| Error::new(Kind::ServerNotFound, "SERVER_NOT_FOUND", message);
    if let Some(named) = env::var_os("STELLATED").filter(|named| !named.is_empty()).map(PathBuf::from) {
        let path = Some(named.clone()).filter(|path| runs(path)).or_else(|| on_path(&named));
        let what = || none(format!("$STELLATED is {}, which is no program", named.display()));
        return path.ok_or_else(what);
    }
    let build = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../build");
    let mut built: Vec<PathBuf> = fs::read_dir(build)
        .map(|entries| entries.flatten().map(|entry| entry.path().join("bin/stellated")).collect())
        .unwrap_or_default();
    built.sort_by_key(|path| !path.ends_with("release/bin/stellated"));
    built.into_iter().find(|path| runs(path)).or_else(|| on_path(Path::new("stellated"))).ok_or_else(|| {
        none(
            "no server was given and no stellated found to start: give a Connection, or set $STELLATED to \
             the binary, or put it on PATH, or build it (clients/quickstart does)"
                .to_string(),
        )
    })
}

impl Server {
    /// Starts it, and returns when it listens.
    pub fn start(options: &ServerOptions) -> Result<Self, Error> {
        let binary = options.binary.clone().map_or_else(find_stellated, Ok)?;
        let mut flags = vec!["--drain-seconds".to_string(), "0".to_string()];
        if options.listen.is_none() {
            // One that answers no pings is merely busy in an oracle.
            flags.extend(["--keepalive", "600", "--keepalive-timeout", "600"].map(String::from));
        }
        flags.extend(options.flags.iter().cloned());
        Server::launch(&binary, &flags, options.listen.clone())
    }

    fn launch(binary: &Path, flags: &[String], listen: Option<String>) -> Result<Self, Error> {
        let cannot = |error: std::io::Error| {
            let message = format!("cannot start {}: {error}", binary.display());
            Error::new(Kind::ServerNotFound, "SERVER_NOT_FOUND", message)
        };
        let folder = private_folder().map_err(cannot)?;
        let private = listen.is_none();
        let socket = || format!("unix:{}", folder.join("socket").display());
        let mut command = Command::new(binary);
        command.args(["--exit-with-parent", "--listen"]);
        command.arg(listen.unwrap_or_else(socket));
        command.args(flags).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        command.process_group(0); // Ctrl-C is for the client
        let mut child = command.spawn().map_err(|error| {
            let _ = fs::remove_dir_all(&folder); // which is empty
            cannot(error)
        })?;
        let words = Arc::new(Mutex::new(String::new()));
        let (out, mut err) = (child.stdout.take(), child.stderr.take());
        let kept = Arc::clone(&words);
        thread::spawn(move || {
            let mut block = [0; 1024];
            while let Some(n @ 1..) = err.as_mut().and_then(|err| err.read(&mut block).ok()) {
                let mut words = kept.lock().unwrap_or_else(PoisonError::into_inner);
                words.push_str(&String::from_utf8_lossy(&block[..n]));
                let extra = words.len().saturating_sub(2000);
                let cut = (extra..=words.len()).find(|&at| words.is_char_boundary(at)).unwrap_or(extra);
                words.drain(..cut);
            }
        });
        let process = Arc::new(Process { child: Mutex::new(child), words, folder });
        let mut line = String::new();
        let said = out.map(|out| BufReader::new(out).read_line(&mut line));
        match line.trim_end().split_once(" listening on ") {
            Some((_, address)) if said.is_some() => {
                Ok(Server { address: address.to_string(), private, process })
            }
            _ => {
                let _ = process.child.lock().map(|mut child| child.wait());
                Err(process.why_gone().unwrap_or_else(|| Error::protocol("it said nothing")))
            }
        }
    }

    /// Where clients reach it, "unix:/path" or "host:port".
    pub fn address(&self) -> &str {
        &self.address
    }

    pub(crate) fn process(&self) -> Arc<Process> {
        Arc::clone(&self.process)
    }
}

impl Process {
    /// With the last words of a server that is no more; None for one that runs.
    pub fn why_gone(&self) -> Option<Error> {
        let mut child = self.child.lock().unwrap_or_else(PoisonError::into_inner);
        let status = child.try_wait().ok().flatten()?;
        let words = self.words.lock().unwrap_or_else(PoisonError::into_inner);
        let message = format!("stellated ended ({status}): {}", words.trim());
        Some(Error::new(Kind::Unavailable, "SERVER_GONE", message))
    }
}

impl Drop for Process {
    /// Stops the server and removes its directory.
    fn drop(&mut self) {
        let child = self.child.get_mut().unwrap_or_else(PoisonError::into_inner);
        if child.try_wait().ok().flatten().is_none() {
            // The standard library can only kill.
            let _ = Command::new("kill").arg(child.id().to_string()).status();
            let begin = Instant::now();
            while begin.elapsed() < STOP_TIME && child.try_wait().ok().flatten().is_none() {
                thread::sleep(Duration::from_millis(5));
            }
            let _ = child.kill();
            let _ = child.wait();
        }
        let _ = fs::remove_dir_all(&self.folder);
    }
}

fn private_folder() -> std::io::Result<PathBuf> {
    use std::os::unix::fs::DirBuilderExt;
    let pid = std::process::id();
    let mut last = None;
    for attempt in 0..100u32 {
        let nanos = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
        let name = format!("stellate-{pid}-{attempt}-{}", nanos.unwrap_or_default().subsec_nanos());
        let path = env::temp_dir().join(name);
        match fs::DirBuilder::new().mode(0o700).create(&path) {
            Ok(()) => return Ok(path),
            Err(error) => last = Some(error),
        }
    }
    Err(last.unwrap_or_else(|| std::io::Error::other("no name is free")))
}
