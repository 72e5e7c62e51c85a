//! A base answers programs on this machine by a process of its own: figures for Prometheus, a page for browsers.

use super::figures::figures;
use super::{cannot, say};
use crate::base::report::page_of;
use crate::base::status::{STATUS_FILE, Status, is_running};
use crate::base::traffic::Traffic;
use crate::error::FleetError;
use std::net::{SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use tessera_outputs::ToolError;
use tessera_report::{Answer, LivePage, METRICS_PATH, PageServer, answer};

/// Answers Prometheus, whether or not the base runs: that it does not is a figure too.
pub(super) fn serve_metrics(folder: &Path, address: SocketAddr) -> Result<(), FleetError> {
    let refused = |error| FleetError::Arguments(format!("--metrics {address}: {error}"));
    let listener = TcpListener::bind(address).map_err(refused)?;
    let bound = listener.local_addr().map_err(refused)?;
    say(&format!("metrics on http://{bound}{METRICS_PATH}, for this machine alone"))?;
    loop {
        let (stream, _) = listener.accept().map_err(cannot("metrics"))?;
        // A client that goes away harms itself alone.
        let _ = answer(stream, METRICS_PATH, || match Status::read(folder) {
            Ok(status) => figures(&status, is_running(folder)).into(),
            Err(error) => {
                let body = format!("{error}\n").into();
                Answer { status: "503 Service Unavailable", head: String::new(), body }
            }
        });
    }
}

/// Shows the report of a base as it is now.
pub(super) fn serve_page(folder: &Path) -> Result<(), FleetError> {
    let server = PageServer::open()?;
    say(&format!("{} shows the base to browsers on this machine; Ctrl-C ends this", server.url()?))?;
    Err(server.serve(&BasePage(folder.to_owned())).into())
}

/// The report of a base while it goes on.
struct BasePage(PathBuf);

impl LivePage for BasePage {
    fn growing(&self) -> PathBuf {
        self.0.join(STATUS_FILE)
    }

    fn make(&self) -> Result<String, ToolError> {
        let status = Status::read(&self.0).map_err(|error| ToolError::Input(error.to_string()))?;
        Ok(page_of(&self.0, &status, &Traffic::read(&self.0)))
    }
}
