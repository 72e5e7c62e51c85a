//! Messages as bytes: readers and writers that look at nothing but the encapsulation.

use super::wrong;
use crate::carrier::{Bytes, CarrierError, ENCAPSULATION, Publication, Subscription};
use rustdds::bytes::Bytes as Body;
use rustdds::{RepresentationIdentifier, no_key};
use std::io;

/// Passes bytes through, behind their encapsulation.
pub(super) struct RawBytes;

#[derive(Clone)]
pub(super) struct RawDecoder;

impl no_key::DeserializerAdapter<Bytes> for RawBytes {
    type Error = io::Error;
    type Decoded = Bytes;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE, RepresentationIdentifier::CDR_BE]
    }

    fn transform_decoded(decoded: Bytes) -> Bytes {
        decoded
    }
}

impl<'de> no_key::Decode<'de, Bytes> for RawDecoder {
    type Error = io::Error;

    fn decode_bytes(self, body: &'de [u8], encoding: RepresentationIdentifier) -> Result<Bytes, io::Error> {
        let order = u8::from(encoding == RepresentationIdentifier::CDR_LE);
        let mut message = Vec::with_capacity(ENCAPSULATION.saturating_add(body.len()));
        message.extend([0, order, 0, 0]);
        message.extend(body);
        Ok(message)
    }
}

impl no_key::DefaultDecoder<Bytes> for RawBytes {
    type Decoder = RawDecoder;
    const DECODER: RawDecoder = RawDecoder;
}

impl no_key::SerializerAdapter<Body> for RawBytes {
    type Error = io::Error;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Body) -> Result<Body, io::Error> {
        Ok(value.clone())
    }
}

pub(super) struct DdsReader {
    pub(super) reader: no_key::DataReader<Bytes, RawBytes>,
    pub(super) topic: String,
}

impl Subscription for DdsReader {
    fn take(&mut self) -> Result<Option<Bytes>, CarrierError> {
        match self.reader.take_next_sample() {
            Ok(sample) => Ok(sample.map(no_key::DataSample::into_value)),
            Err(error) => Err(wrong(&format!("read {}", self.topic), &error)),
        }
    }
}

pub(super) struct DdsWriter {
    pub(super) writer: no_key::DataWriter<Body, RawBytes>,
    pub(super) topic: String,
}

impl Publication for DdsWriter {
    fn send(&mut self, message: &[u8]) -> Result<(), CarrierError> {
        let body = Body::copy_from_slice(message.get(ENCAPSULATION..).unwrap_or_default());
        self.writer.write(body, None).map_err(|error| wrong(&format!("write {}", self.topic), &error))
    }
}
