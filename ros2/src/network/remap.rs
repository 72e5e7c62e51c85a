//! Names of topics and services that are others in the network, as `--remap` has them: for each `from` of
//! this program the name that others have.

use crate::carrier::{
    Carrier, CarrierError, Publication, Quality, RosType, Seen, Server, Service, Subscription,
};
use std::collections::BTreeSet;
use std::time::Duration;

/// A name of this program, and what it is in the network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Remap {
    from: String,
    to: String,
}

/// Parses `FROM:=TO`.
///
/// # Errors
/// Says what is expected.
pub(crate) fn parse_remap(text: &str) -> Result<Remap, String> {
    let names = text.split_once(":=").filter(|(from, to)| [from, to].iter().all(|name| is_name(name)));
    let (from, to) = names.ok_or("expected FROM:=TO with names such as /tf:=/robot1/tf")?;
    Ok(Remap { from: from.to_owned(), to: to.to_owned() })
}

/// Whether this is a whole name of a topic, a service or a namespace.
pub(crate) fn is_name(text: &str) -> bool {
    text.len() > 1
        && text.starts_with('/')
        && !text.ends_with('/')
        && !text.contains("//")
        && text.bytes().all(|b| b.is_ascii_alphanumeric() || b"/_".contains(&b))
}

/// A carrier in which names are others.
pub(crate) struct Remapped {
    pub(crate) carrier: Box<dyn Carrier>,
    pub(crate) names: Vec<Remap>,
}

impl Remapped {
    fn name<'a>(&'a self, name: &'a str) -> &'a str {
        // The first one that fits, as in ROS.
        self.names.iter().find(|remap| remap.from == name).map_or(name, |remap| &remap.to)
    }
}

impl Carrier for Remapped {
    fn subscribe(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Subscription>, CarrierError> {
        let name = self.name(topic).to_owned();
        self.carrier.subscribe(&name, kind, quality)
    }

    fn publish(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Publication>, CarrierError> {
        let name = self.name(topic).to_owned();
        self.carrier.publish(&name, kind, quality)
    }

    fn serve(&mut self, name: &str, service: Service) -> Result<Box<dyn Server>, CarrierError> {
        let name = self.name(name).to_owned();
        self.carrier.serve(&name, service)
    }

    fn wait(&mut self, timeout: Duration) -> bool {
        self.carrier.wait(timeout)
    }

    fn has_ended(&mut self) -> bool {
        self.carrier.has_ended()
    }

    fn introduce(&mut self) -> Result<(), CarrierError> {
        self.carrier.introduce()
    }

    fn seen(&self) -> Vec<Seen> {
        self.carrier.seen()
    }

    fn read_topics(&self) -> BTreeSet<String> {
        let mut read = self.carrier.read_topics();
        let own: Vec<String> = self
            .names
            .iter()
            .filter(|remap| read.contains(&remap.to))
            .map(|remap| remap.from.clone())
            .collect();
        read.extend(own);
        read
    }

    fn unmatched(&self) -> Vec<String> {
        self.carrier.unmatched()
    }

    fn alone(&self) -> Option<String> {
        self.carrier.alone()
    }

    fn words(&self) -> Vec<String> {
        self.carrier.words()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_whole_and_others_have_their_words() {
        let found = parse_remap("/tf:=/robot1/tf").unwrap();
        assert_eq!((found.from.as_str(), found.to.as_str()), ("/tf", "/robot1/tf"));
        for wrong in
            ["/tf", "/tf=/x", "tf:=/x", "/tf:=x", "/tf:=/x/", "/tf:=/x//y", "/tf:=/", ":=", "/a b:=/c"]
        {
            assert!(parse_remap(wrong).unwrap_err().contains("expected FROM:=TO"), "{wrong}");
        }
    }
}
