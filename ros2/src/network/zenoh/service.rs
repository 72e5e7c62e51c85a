//! Services as rmw_zenoh has them: a queryable; a request has its number and its client beside it, and so
//! has the reply.

use super::attachment::Attachment;
use super::ends::checked;
use super::{lock, wrong};
use crate::carrier::{Bytes, CarrierError, Client, Server, Service, ServiceRequest};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex};
use zenoh::liveliness::LivelinessToken;
use zenoh::query::{Query, Queryable};
use zenoh::{Session, Wait};

/// Requests that wait to be taken at most; more are refused.
const MOST_WAITING: usize = 64;

/// Answers requests.
pub(super) struct ZenohServer {
    name: String,
    service: Service,
    requests: Arc<Mutex<VecDeque<Query>>>,
    /// Requests that were taken, by a number of their own.
    taken: BTreeMap<u64, (Query, Attachment)>,
    n_taken: u64,
    _queryable: Queryable<()>,
    _token: LivelinessToken,
}

impl ZenohServer {
    /// Answers from now on.
    ///
    /// # Errors
    /// Where the session is closed.
    pub(super) fn open(
        session: &Session,
        (name, key, service): (&str, String, Service),
        token: LivelinessToken,
    ) -> Result<Self, CarrierError> {
        let requests = Arc::<Mutex<VecDeque<Query>>>::default();
        let to = Arc::clone(&requests);
        let queryable = session
            .declare_queryable(key)
            // rmw_zenoh asks complete ones alone.
            .complete(true)
            .callback(move |query| {
                let mut waiting = lock(&to);
                if waiting.len() < MOST_WAITING {
                    waiting.push_back(query);
                }
            })
            .wait()
            .map_err(|error| wrong(&format!("serve {name}"), &error))?;
        Ok(Self {
            name: name.to_owned(),
            service,
            requests,
            taken: BTreeMap::new(),
            n_taken: 0,
            _queryable: queryable,
            _token: token,
        })
    }
}

/// A request that can be answered, and its attachment.
fn read(query: &Query, service: Service) -> Result<(Bytes, Attachment), String> {
    let payload = query.payload().map(|payload| payload.to_bytes().into_owned());
    let request = checked(payload.ok_or("no message, expected CDR")?)?;
    if !(service.is_request)(&request) {
        return Err(format!("{} bytes, expected a request of {}", request.len(), service.kind.name));
    }
    let attachment = query.attachment().map(zenoh::bytes::ZBytes::to_bytes);
    Ok((request, Attachment::read(attachment.as_deref())?))
}

impl Server for ZenohServer {
    fn take(&mut self) -> Result<Option<ServiceRequest>, CarrierError> {
        let Some(query) = lock(&self.requests).pop_front() else { return Ok(None) };
        match read(&query, self.service) {
            Ok((request, attachment)) => {
                self.n_taken = self.n_taken.saturating_add(1);
                self.taken.insert(self.n_taken, (query, attachment));
                let client = Client(self.n_taken.to_le_bytes().to_vec());
                Ok(Some(ServiceRequest { client, request }))
            }
            Err(words) => {
                // The one that asked may be gone.
                let _ = query.reply_err(words.as_str()).wait();
                Err(wrong(&format!("read a request of {}", self.name), &words))
            }
        }
    }

    fn answer(&mut self, client: &Client, message: &[u8]) -> Result<(), CarrierError> {
        let number = client.0.as_slice().try_into().map(u64::from_le_bytes).unwrap_or_default();
        let Some((query, attachment)) = self.taken.remove(&number) else {
            return Err(wrong(&format!("answer {}", self.name), &"no such request"));
        };
        let reply = query.reply(query.key_expr().clone(), message).attachment(attachment.bytes());
        reply.wait().map_err(|error| wrong(&format!("answer {}", self.name), &error))
    }
}
