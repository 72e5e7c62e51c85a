//! A run directory on this machine's disk, asked as a robot is.

use crate::copies::arrivals::DISK;
use crate::error::FleetError;
use crate::robot::served::Served;
use crate::wire::carrier::RobotCarrier;
use crate::wire::piece::Piece;
use crate::wire::request::{PieceRefusal, Request};
use std::path::Path;

/// The way to a folder.
pub struct LocalCarrier(Served);

impl LocalCarrier {
    /// The way to the run in a folder.
    ///
    /// # Errors
    /// Where it has no `run.json`.
    pub fn open(folder: &Path) -> Result<Self, FleetError> {
        Served::open(folder).map(Self).map_err(FleetError::io("read the run in", folder))
    }
}

impl RobotCarrier for LocalCarrier {
    fn robots(&mut self) -> Vec<String> {
        vec![DISK.into()]
    }

    fn ask(
        &mut self,
        _robot: &str,
        request: &Request,
        take: &mut dyn FnMut(Result<Piece, PieceRefusal>) -> bool,
    ) {
        self.0.answer(request, &mut |piece| take(Ok(piece)));
    }
}
