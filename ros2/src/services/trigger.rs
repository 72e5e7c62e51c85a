//! Services of the type `std_srvs/srv/Trigger`: a request without content, answered with success and words.

use crate::carrier::{Carrier, CarrierError, Client, Server, TRIGGER};
use crate::error::Ros2Error;
use crate::report::{Report, ReportEvent};
use serde::Serialize;
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

/// One such service.
pub(crate) struct Trigger(Box<dyn Server>);

impl Trigger {
    /// Announces it under that name.
    ///
    /// # Errors
    /// Where the network refuses it.
    pub(crate) fn new(carrier: &mut dyn Carrier, name: &str) -> Result<Self, CarrierError> {
        Ok(Self(carrier.serve(name, TRIGGER)?))
    }

    /// The client of the oldest request that waits; requests that cannot be read are told and left out.
    pub(crate) fn take(&mut self, report: &mut Report) -> Option<Client> {
        loop {
            match self.0.take() {
                Ok(asked) => return asked.map(|asked| asked.client),
                Err(error) => report.note(ReportEvent::Carrier, || error.to_string()),
            }
        }
    }

    /// Answers a request.
    ///
    /// # Errors
    /// Where the response cannot be written as CDR.
    pub(crate) fn answer(
        &mut self,
        client: &Client,
        response: &Response,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        if let Err(error) = self.0.answer(client, &encode(response)?) {
            report.note(ReportEvent::Carrier, || error.to_string());
        }
        Ok(())
    }
}
