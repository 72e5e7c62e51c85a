//! What came of asking a robot: an answer as it comes, and what of it was refused.

use crate::robot::served::REPLACED;
use crate::wire::carrier::RobotCarrier;
use crate::wire::piece::{Piece, PieceKind};
use crate::wire::request::{Offer, PROTOCOL, PieceRefusal, Request, SMALL_FILES};

/// What came of asking.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Pulled {
    /// Bytes of files that were taken in.
    pub taken_bytes: u64,
    /// Bytes that came, those of refused pieces and those that came twice included.
    pub received_bytes: u64,
    /// What was refused, with words where there are some.
    pub refused: Vec<(PieceRefusal, String)>,
}

impl Pulled {
    /// Counts bytes that were taken.
    pub(crate) fn took(&mut self, n: usize) {
        self.taken_bytes = self.taken_bytes.saturating_add(n as u64);
    }

    /// Counts the bytes of a piece, or why it is none.
    fn receive(&mut self, piece: Result<Piece, PieceRefusal>) -> Option<Piece> {
        let piece = piece.map_err(|refusal| self.refuse(refusal, "")).ok()?;
        self.received_bytes = self.received_bytes.saturating_add(piece.wire_bytes as u64);
        Some(piece)
    }

    pub(crate) fn refuse(&mut self, refusal: PieceRefusal, words: impl Into<String>) {
        self.refused.push((refusal, words.into()));
    }
}

/// An answer as it comes.
pub(crate) struct ComingAnswer {
    identity: u64,
    /// Offset of the first byte that is wanted.
    at: u64,
    most: usize,
    pub(crate) bytes: Vec<u8>,
    pub(crate) is_whole: bool,
}

impl ComingAnswer {
    /// Nothing has come yet of `most` bytes from `at` on.
    pub(crate) fn new(identity: u64, at: u64, most: usize) -> Self {
        Self { identity, at, most, bytes: Vec::new(), is_whole: false }
    }

    /// Takes a piece; `false`: enough.
    pub(crate) fn take(&mut self, piece: Result<Piece, PieceRefusal>, pulled: &mut Pulled) -> bool {
        // What comes behind a refused one does not continue what is here.
        let Some(piece) = pulled.receive(piece) else { return true };
        if piece.kind == PieceKind::Refused {
            let words = refusal_words(&piece);
            let refusal =
                if words.starts_with(REPLACED) { PieceRefusal::Replaced } else { PieceRefusal::OtherRun };
            pulled.refuse(refusal, words);
            return false;
        }
        if piece.identity != self.identity {
            pulled.refuse(PieceRefusal::OtherRun, format!("a piece of run {:016x}", piece.identity));
            return true;
        }
        let next = self.at.saturating_add(self.bytes.len() as u64);
        if piece.at != next {
            pulled.refuse(PieceRefusal::OtherPlace, format!("a piece at {}, expected {next}", piece.at));
            return true;
        }
        if piece.kind == PieceKind::End {
            self.is_whole = true;
            return false;
        }
        if self.bytes.len().saturating_add(piece.bytes.len()) > self.most {
            pulled.refuse(PieceRefusal::TooLarge, format!("more than {} bytes", self.most));
            return false;
        }
        self.bytes.extend(piece.bytes);
        true
    }
}

/// Why a robot has nothing to give.
fn refusal_words(piece: &Piece) -> String {
    String::from_utf8_lossy(&piece.bytes).chars().take(200).collect()
}

/// Asks a robot which run it has.
pub fn ask_offer(carrier: &mut dyn RobotCarrier, robot: &str, pulled: &mut Pulled) -> Option<Offer> {
    let mut found = None;
    carrier.ask(robot, &Request::Offer, &mut |piece| {
        let Some(piece) = pulled.receive(piece) else { return true };
        if piece.kind != PieceKind::Data {
            pulled.refuse(PieceRefusal::Offer, refusal_words(&piece));
            return false;
        }
        match read_offer(&piece) {
            Ok(offer) => found = Some(offer),
            Err((refusal, words)) => pulled.refuse(refusal, words),
        }
        false
    });
    found
}

fn read_offer(piece: &Piece) -> Result<Offer, (PieceRefusal, String)> {
    let offer: Offer =
        serde_json::from_slice(&piece.bytes).map_err(|e| (PieceRefusal::Offer, format!("no offer: {e}")))?;
    let own = env!("CARGO_PKG_VERSION");
    if offer.protocol != PROTOCOL || offer.version != own {
        let Offer { protocol, version, .. } = offer;
        let words = format!("protocol {protocol} of version {version:?}, expected {PROTOCOL} of {own}");
        return Err((PieceRefusal::Offer, words));
    }
    if offer.identity != piece.identity {
        return Err((PieceRefusal::OtherRun, "an offer of another run than its label says".into()));
    }
    if tessera_transport::check_name(&offer.run).is_err() {
        return Err((
            PieceRefusal::Name,
            format!("a run {:?}", offer.run.chars().take(80).collect::<String>()),
        ));
    }
    if offer.small.keys().any(|name| !SMALL_FILES.contains(&name.as_str())) {
        return Err((PieceRefusal::Offer, "a file that no run has".into()));
    }
    Ok(offer)
}
