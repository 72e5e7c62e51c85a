//! The service `reset`: the run ends, with its outputs written, and another one begins.

use crate::carrier::{Carrier, CarrierError, Client};
use crate::error::Ros2Error;
use crate::report::Report;
use crate::services::trigger::{Response, Trigger};

/// Requests that one reset serves at most; more are refused.
const MOST_WAITING: usize = 16;

/// The service, and the clients that wait for a reset.
pub(crate) struct Reset {
    service: Trigger,
    waiting: Vec<Client>,
}

impl Reset {
    /// Announces the service.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(crate) fn new(carrier: &mut dyn Carrier, namespace: &str) -> Result<Self, CarrierError> {
        let service = Trigger::new(carrier, &format!("{namespace}/reset"))?;
        Ok(Self { service, waiting: Vec::new() })
    }

    /// Takes requests in, or answers them with `refusal`; whether a client waits for a reset.
    ///
    /// # Errors
    /// Where a response cannot be written as CDR.
    pub(crate) fn step(&mut self, refusal: Option<&str>, report: &mut Report) -> Result<bool, Ros2Error> {
        while let Some(client) = self.service.take(report) {
            let too_many = (self.waiting.len() == MOST_WAITING).then_some("too many requests wait");
            match refusal.or(too_many) {
                Some(why) => {
                    report.say(&format!("reset: {why}"));
                    self.service.answer(&client, &Response::refused(why.to_owned()), report)?;
                }
                None => self.waiting.push(client),
            }
        }
        Ok(!self.waiting.is_empty())
    }

    /// Answers all clients that wait.
    ///
    /// # Errors
    /// As [`Self::step`].
    pub(crate) fn answer(&mut self, response: &Response, report: &mut Report) -> Result<(), Ros2Error> {
        for client in std::mem::take(&mut self.waiting) {
            report.say(&format!("reset: {}", response.message));
            self.service.answer(&client, response, report)?;
        }
        Ok(())
    }
}
