//! Services of the type `std_srvs/srv/Trigger`: a request without content, answered with success and words.

use crate::carrier::{Carrier, CarrierError, Client, Server, TRIGGER};
use crate::error::Ros2Error;
use crate::report::{Report, ReportEvent};
use serde::Serialize;
use std::collections::VecDeque;
use tessera_recording::ros::encode;

/// `std_srvs/srv/Trigger_Response`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Response {
    pub(crate) success: bool,
    pub(crate) message: String,
}

impl Response {
    pub(crate) fn refused(message: String) -> Self {
        Self { success: false, message }
    }
}

/// Requests that wait at most; more are refused.
const MOST_WAITING: usize = 16;

/// One such service, and the clients that wait for an answer.
pub(crate) struct Trigger {
    name: &'static str,
    server: Box<dyn Server>,
    pub(crate) waiting: VecDeque<Client>,
}

impl Trigger {
    /// Announces it under that name.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(crate) fn new(
        carrier: &mut dyn Carrier,
        namespace: &str,
        name: &'static str,
    ) -> Result<Self, CarrierError> {
        let server = carrier.serve(&format!("{namespace}/{name}"), TRIGGER)?;
        Ok(Self { name, server, waiting: VecDeque::new() })
    }

    /// Takes requests in, or answers them with `refusal`; whether a client waits. Requests that cannot be read
    /// are told and left out.
    ///
    /// # Errors
    /// Where a response cannot be written as CDR.
    pub(crate) fn take(&mut self, refusal: Option<&str>, report: &mut Report) -> Result<bool, Ros2Error> {
        loop {
            let client = match self.server.take() {
                Ok(Some(asked)) => asked.client,
                Ok(None) => return Ok(!self.waiting.is_empty()),
                Err(error) => {
                    report.note(ReportEvent::Carrier, || error.to_string());
                    continue;
                }
            };
            let too_many = (self.waiting.len() == MOST_WAITING).then_some("too many requests wait");
            match refusal.or(too_many) {
                Some(why) => self.answer(&client, &Response::refused(why.to_owned()), report)?,
                None => self.waiting.push_back(client),
            }
        }
    }

    /// Answers all clients that wait.
    ///
    /// # Errors
    /// As [`Self::take`].
    pub(crate) fn answer_all(&mut self, response: &Response, report: &mut Report) -> Result<(), Ros2Error> {
        while let Some(client) = self.waiting.pop_front() {
            self.answer(&client, response, report)?;
        }
        Ok(())
    }

    /// Answers a request.
    ///
    /// # Errors
    /// As [`Self::take`].
    pub(crate) fn answer(
        &mut self,
        client: &Client,
        response: &Response,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        report.say(&format!("{}: {}", self.name, response.message));
        if let Err(error) = self.server.answer(client, &encode(response)?) {
            report.note(ReportEvent::Carrier, || error.to_string());
        }
        Ok(())
    }
}
