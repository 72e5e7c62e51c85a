//! Parameters of the node as `ros2 param` and rqt ask for them: the options of the command line, to be
//! listed, read and described. They are read once, when the program starts, so that each setting is refused.

mod events;
mod table;
mod wire;

use crate::arguments::Ros2Arguments;
use crate::carrier::{Carrier, CarrierError, Server};
use crate::error::Ros2Error;
use crate::report::{Report, ReportEvent};
use events::ParameterEvents;
use tessera_recording::ros::encode;
use wire::{
    DESCRIBE, GET, LIST, Listed, ParameterDescriptor, ParameterValue, SET, SET_ATOMICALLY, SetResult, TYPES,
    names, prefixes,
};

pub(crate) use table::NodeParameter;

/// What is asked of the parameters.
#[derive(Clone, Copy, Debug)]
enum Question {
    List,
    Get,
    Types,
    Describe,
    Set,
    SetAtomically,
}

/// The services of parameters, and their topic.
pub(crate) struct NodeParameters {
    /// With its namespace.
    node: String,
    servers: Vec<(Question, Box<dyn Server>)>,
    events: ParameterEvents,
    parameters: Vec<NodeParameter>,
}

impl NodeParameters {
    /// Announces services and topic.
    ///
    /// # Errors
    /// Where the network refuses one of them.
    pub(crate) fn new(carrier: &mut dyn Carrier, arguments: &Ros2Arguments) -> Result<Self, CarrierError> {
        let services = [
            (Question::List, "list_parameters", LIST),
            (Question::Get, "get_parameters", GET),
            (Question::Types, "get_parameter_types", TYPES),
            (Question::Describe, "describe_parameters", DESCRIBE),
            (Question::Set, "set_parameters", SET),
            (Question::SetAtomically, "set_parameters_atomically", SET_ATOMICALLY),
        ];
        let mut open = |(question, name, service)| {
            Ok((question, carrier.serve(&format!("{}/{name}", arguments.namespace), service)?))
        };
        let servers = services.into_iter().map(&mut open).collect::<Result<_, CarrierError>>()?;
        let events = ParameterEvents::new(carrier)?;
        let node = arguments.namespace.clone();
        Ok(Self { node, servers, events, parameters: NodeParameter::all(arguments) })
    }

    /// Answers what was asked; `now_nanos` is the node's time.
    ///
    /// # Errors
    /// Where a message cannot be written as CDR.
    pub(crate) fn step(
        &mut self,
        carrier: &dyn Carrier,
        now_nanos: Option<i64>,
        report: &mut Report,
    ) -> Result<(), Ros2Error> {
        let Self { node, servers, events, parameters } = self;
        match events.step(carrier, node, parameters, now_nanos.unwrap_or_default()) {
            Err(Ros2Error::Carrier(error)) => report.note(ReportEvent::Carrier, || error.to_string()),
            told => told?,
        }
        for (question, server) in servers {
            loop {
                let answered = match server.take() {
                    Ok(None) => break,
                    Ok(Some(asked)) => match answer(parameters, *question, &asked.request)? {
                        Some(message) => server.answer(&asked.client, &message),
                        // Whatever takes requests looks at them first.
                        None => Ok(()),
                    },
                    Err(error) => Err(error),
                };
                if let Err(error) = answered {
                    report.note(ReportEvent::Carrier, || error.to_string());
                }
            }
        }
        Ok(())
    }
}

/// The answer, with its encapsulation; `None` to what is no request.
fn answer(
    parameters: &[NodeParameter],
    question: Question,
    request: &[u8],
) -> Result<Option<Vec<u8>>, Ros2Error> {
    let find = |name: &String| parameters.iter().find(|parameter| parameter.name == *name);
    let asked = match question {
        Question::List => prefixes(request),
        Question::Set | Question::SetAtomically => wire::to_set(request),
        Question::Get | Question::Types | Question::Describe => names(request),
    };
    let Some(asked) = asked else { return Ok(None) };
    // A name that is none has its place among the answers: a value that is not set.
    let values = asked.iter().map(|name| find(name).map(NodeParameter::value).unwrap_or_default());
    Ok(Some(match question {
        // No name has parts, so that a prefix is a name.
        Question::List => {
            let is_asked = |name: &String| asked.is_empty() || asked.contains(name);
            let names = parameters.iter().map(|parameter| parameter.name.clone()).filter(is_asked);
            encode(&Listed { names: names.collect(), prefixes: Vec::new() })?
        }
        Question::Get => encode(&values.collect::<Vec<ParameterValue>>())?,
        Question::Types => encode(&values.map(|value| value.kind).collect::<Vec<u8>>())?,
        Question::Describe => {
            let one = |name| {
                find(name).map_or_else(|| ParameterDescriptor::unknown(name), NodeParameter::described)
            };
            encode(&asked.iter().map(one).collect::<Vec<ParameterDescriptor>>())?
        }
        Question::Set => {
            encode(&asked.iter().map(|name| refused(name, find(name))).collect::<Vec<SetResult>>())?
        }
        Question::SetAtomically => {
            let nothing = SetResult { successful: true, reason: String::new() };
            encode(&asked.first().map_or(nothing, |name| refused(name, find(name))))?
        }
    }))
}

/// Why a parameter is not set.
fn refused(name: &str, found: Option<&NodeParameter>) -> SetResult {
    let reason = match found {
        Some(_) => {
            format!("{name} is read-only: it is read when the program starts (--ros-args -p {name}:=VALUE)")
        }
        None => format!("there is no parameter {name:?}: `ros2 param list` has their names"),
    };
    SetResult { successful: false, reason }
}

#[cfg(test)]
mod tests;
