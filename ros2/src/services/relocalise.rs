//! The service `relocalise`: with the next image the run is asked to look for its place anew.

use crate::camera::sender::Sender;
use crate::carrier::{Carrier, CarrierError};
use crate::error::Ros2Error;
use crate::report::Report;
use crate::services::trigger::{Response, Trigger};
use std::time::{Duration, Instant};

/// Time in which an image must go into the run.
const MOST_TO_SEND: Duration = Duration::from_secs(5);

/// The service, whose clients wait for an image.
pub(crate) struct Relocalise {
    service: Trigger,
    /// When the first of the clients that wait came.
    since: Instant,
    /// The sender knows.
    is_told: bool,
}

impl Relocalise {
    /// Announces the service.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(crate) fn new(carrier: &mut dyn Carrier, namespace: &str) -> Result<Self, CarrierError> {
        let service = Trigger::new(carrier, namespace, "relocalise")?;
        Ok(Self { service, since: Instant::now(), is_told: false })
    }

    /// Takes requests in, has the next image ask for them, and answers those for which one did.
    ///
    /// # Errors
    /// Where a response cannot be written as CDR.
    pub(crate) fn step(
        &mut self,
        run: &str,
        sender: Option<&mut Sender>,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        if !self.take(report)? {
            return Ok(());
        }
        let is_late = self.since.elapsed() > MOST_TO_SEND;
        let response = match sender {
            Some(sender) if !self.is_told => {
                sender.asks_relocalisation = true;
                self.is_told = true;
                return Ok(());
            }
            Some(sender) if !sender.asks_relocalisation => {
                Response { success: true, message: format!("the run {run} looks for its place anew") }
            }
            sender if is_late => {
                if let Some(sender) = sender {
                    sender.asks_relocalisation = false;
                }
                Response::refused(format!(
                    "no image went into the run {run} for {} s: nothing was asked of it",
                    MOST_TO_SEND.as_secs()
                ))
            }
            _ => return Ok(()),
        };
        self.service.answer_all(&response, report)
    }

    /// Takes requests in and refuses all: there is no run that could be asked.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub(crate) fn refuse(
        &mut self,
        why: &str,
        sender: Option<&mut Sender>,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        self.take(report)?;
        if let Some(sender) = sender {
            sender.asks_relocalisation = false;
        }
        self.service.answer_all(&Response::refused(why.to_owned()), report)
    }

    fn take(&mut self, report: &mut Report) -> Result<bool, Ros2Error> {
        let is_first = self.service.waiting.is_empty();
        let is_asked = self.service.take(None, report)?;
        if is_first && is_asked {
            (self.since, self.is_told) = (Instant::now(), false);
        }
        Ok(is_asked)
    }
}
