//! Services over DDS. Who asked stands in the message itself with rmw_cyclonedds (the client's number and
//! the request's, before the content) and beside it with rmw_fastrtps (the identity of the request, in
//! inline QoS). A server here answers each client in its own way.

use super::raw::{DdsReader, DdsWriter};
use super::wrong;
use crate::carrier::{Bytes, CarrierError, Client, ENCAPSULATION, Publication, Server};
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
}

impl Server for DdsServer {
    fn take(&mut self) -> Result<Option<Client>, CarrierError> {
        let taken = self.requests.reader.take_next_sample();
        let sample = taken.map_err(|error| wrong(&format!("read {}", self.requests.topic), &error))?;
        let Some(sample) = sample else { return Ok(None) };
        let info = sample.sample_info();
        let mut asked = info.sample_identity();
        // The end that waits for the reply, where it says so.
        if let Some(waiting) = info.related_sample_identity() {
            asked.writer_guid = waiting.writer_guid;
        }
        Ok(Some(client(sample.value(), &asked)))
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

/// Who sent this request: its header, little-endian, where it has one, else its identity. A request
/// without content is one byte, so that its length tells.
fn client(request: &Bytes, asked: &SampleIdentity) -> Client {
    let is_big_endian = request.get(1) == Some(&0);
    let body = request.get(ENCAPSULATION..).unwrap_or_default();
    match body.split_at_checked(HEADER) {
        Some((header, [_, ..])) => {
            let number = |bytes: &[u8]| -> Vec<u8> {
                if is_big_endian { bytes.iter().rev().copied().collect() } else { bytes.to_vec() }
            };
            let (client, of_request) = header.split_at(8);
            Client([number(client), number(of_request)].concat())
        }
        _ => {
            let number = i64::from(asked.sequence_number).to_le_bytes();
            Client([&asked.writer_guid.to_bytes()[..], &number].concat())
        }
    }
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

    #[test]
    fn a_client_is_known_by_its_header_or_by_its_request() {
        let guid = GUID::from_bytes(std::array::from_fn(|k| k as u8));
        let asked = SampleIdentity { writer_guid: guid, sequence_number: SequenceNumber::from(77) };
        let header: Vec<u8> = (0..16).collect();
        let message = |order: u8, body: &[u8]| [&[0, order, 0, 0], body].concat();
        // As rmw_cyclonedds has it: the numbers, then the one byte of a request without content.
        let cyclone = client(&message(1, &[&header[..], &[0, 0, 0, 0]].concat()), &asked);
        assert_eq!((cyclone.0.as_slice(), identity(&cyclone)), (&header[..], None));
        let big = client(&message(0, &[&header[..], &[0]].concat()), &asked);
        assert_eq!(big.0, [7, 6, 5, 4, 3, 2, 1, 0, 15, 14, 13, 12, 11, 10, 9, 8]);
        // As rmw_fastrtps has it: that one byte alone.
        for body in [&[0][..], &[0, 0, 0, 0], &[]] {
            let fast = client(&message(1, body), &asked);
            assert_eq!(identity(&fast), Some(asked));
        }
    }
}
