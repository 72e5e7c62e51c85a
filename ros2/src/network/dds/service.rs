//! Services over DDS. Who asked stands in the message itself with rmw_cyclonedds (the client's number and
//! the request's, before the content) and beside it with rmw_fastrtps (the identity of the request, in
//! inline QoS). A server here answers each client in its own way.

use super::raw::{DdsReader, DdsWriter};
use super::wrong;
use crate::carrier::{
    Bytes, CarrierError, Client, ENCAPSULATION, Publication, Server, Service, ServiceRequest,
};
use rustdds::bytes::Bytes as Body;
use rustdds::{GUID, SampleIdentity, SequenceNumber, WriteOptionsBuilder};

/// Bytes of the numbers that rmw_cyclonedds has before the content: client and request, 8 bytes each.
const HEADER: usize = 16;
/// Bytes of an identity here: the asking end and the number of the request.
const IDENTITY: usize = 16 + 8;

/// Reads requests and writes replies.
pub(super) struct DdsServer {
    pub(super) requests: DdsReader,
    pub(super) replies: DdsWriter,
    pub(super) service: Service,
}

impl Server for DdsServer {
    fn take(&mut self) -> Result<Option<ServiceRequest>, CarrierError> {
        let action = || format!("read {}", self.requests.topic);
        let taken = self.requests.reader.take_next_sample();
        let Some(sample) = taken.map_err(|error| wrong(&action(), &error))? else { return Ok(None) };
        let info = sample.sample_info();
        let mut identity = info.sample_identity();
        // The end that waits for the reply, where it says so.
        let waiting = info.related_sample_identity();
        if let Some(waiting) = &waiting {
            identity.writer_guid = waiting.writer_guid;
        }
        let message = sample.value();
        match asked(message, &identity, waiting.is_some(), self.service.is_request) {
            Some(asked) => Ok(Some(asked)),
            None => {
                let kind = self.service.kind.name;
                let found = format!("{} bytes, expected a request of {kind}", message.len());
                Err(wrong(&action(), &found))
            }
        }
    }

    fn answer(&mut self, client: &Client, message: &[u8]) -> Result<(), CarrierError> {
        let content = message.get(ENCAPSULATION..).unwrap_or_default();
        let Some(asked) = identity(client) else {
            let whole = [&[0; ENCAPSULATION], &client.0[..], content].concat();
            return self.replies.send(&whole);
        };
        let options = WriteOptionsBuilder::new().related_sample_identity(asked).build();
        let written = self.replies.writer.write_with_options(Body::copy_from_slice(content), options);
        written.map(|_| ()).map_err(|error| wrong(&format!("write {}", self.replies.topic), &error))
    }
}

/// The request and who sent it: known by the numbers before its content, or by its identity. Which of both
/// it is tells the content, and where both could be, whether an end that waits stands beside it.
fn asked(
    message: &Bytes,
    identity: &SampleIdentity,
    is_beside: bool,
    is_request: fn(&[u8]) -> bool,
) -> Option<ServiceRequest> {
    let of_fast = || {
        is_request(message)
            .then(|| ServiceRequest { client: by_identity(identity), request: message.clone() })
    };
    let of_cyclone = || headed(message).filter(|asked| is_request(&asked.request));
    if is_beside { of_fast().or_else(of_cyclone) } else { of_cyclone().or_else(of_fast) }
}

/// A message whose content begins with the numbers of client and request, which are kept little-endian.
fn headed(message: &Bytes) -> Option<ServiceRequest> {
    let (encapsulation, body) = message.split_at_checked(ENCAPSULATION)?;
    let (header, content) = body.split_at_checked(HEADER)?;
    if content.is_empty() {
        return None;
    }
    let number = |bytes: &[u8]| -> Vec<u8> {
        let is_big_endian = encapsulation.get(1) == Some(&0);
        if is_big_endian { bytes.iter().rev().copied().collect() } else { bytes.to_vec() }
    };
    let (client, of_request) = header.split_at_checked(8)?;
    let client = Client([number(client), number(of_request)].concat());
    Some(ServiceRequest { client, request: [encapsulation, content].concat() })
}

/// A client that is known by its end and the number of its request.
fn by_identity(identity: &SampleIdentity) -> Client {
    let number = i64::from(identity.sequence_number).to_le_bytes();
    Client([&identity.writer_guid.to_bytes()[..], &number].concat())
}

/// The identity of a client that has no header.
fn identity(client: &Client) -> Option<SampleIdentity> {
    let bytes: &[u8; IDENTITY] = client.0.as_slice().try_into().ok()?;
    let (guid, number) = bytes.split_at(16);
    let writer_guid = GUID::from_bytes(guid.try_into().ok()?);
    let number = i64::from_le_bytes(number.try_into().ok()?);
    Some(SampleIdentity { writer_guid, sequence_number: SequenceNumber::from(number) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carrier::TRIGGER;

    fn ends_with_one(message: &[u8]) -> bool {
        message.len() > ENCAPSULATION && message.last() == Some(&1)
    }

    #[test]
    fn a_client_is_known_by_its_header_or_by_its_request() {
        let guid = GUID::from_bytes(std::array::from_fn(|k| k as u8));
        let by = SampleIdentity { writer_guid: guid, sequence_number: SequenceNumber::from(77) };
        let header: Vec<u8> = (0..16).collect();
        let message = |order: u8, body: &[u8]| [&[0, order, 0, 0], body].concat();
        let client = |message: Bytes| asked(&message, &by, false, TRIGGER.is_request).unwrap().client;
        // As rmw_cyclonedds has it: the numbers, then the one byte of a request without content.
        let cyclone = client(message(1, &[&header[..], &[0, 0, 0, 0]].concat()));
        assert_eq!((cyclone.0.as_slice(), identity(&cyclone)), (&header[..], None));
        let big = client(message(0, &[&header[..], &[0]].concat()));
        assert_eq!(big.0, [7, 6, 5, 4, 3, 2, 1, 0, 15, 14, 13, 12, 11, 10, 9, 8]);
        // As rmw_fastrtps has it: that one byte alone.
        for body in [&[0][..], &[0, 0, 0, 0], &[]] {
            assert_eq!(identity(&client(message(1, body))), Some(by));
        }
        assert_eq!(asked(&message(1, &[0; 9]), &by, false, TRIGGER.is_request), None);
    }

    #[test]
    fn content_comes_without_the_numbers_before_it() {
        let by = SampleIdentity {
            writer_guid: GUID::from_bytes([1; 16]),
            sequence_number: SequenceNumber::from(1),
        };
        let both = [&[0, 1, 0, 0][..], &[9; 16], &[5, 1]].concat();
        let of = |is_beside| asked(&both, &by, is_beside, ends_with_one).unwrap();
        assert_eq!((of(false).request, of(false).client.0.len()), (vec![0, 1, 0, 0, 5, 1], HEADER));
        assert_eq!((of(true).request, of(true).client.0.len()), (both.clone(), IDENTITY));
    }
}
