//! The way between a base and its robots: what replication needs of a network, and nothing more.

use crate::wire::piece::Piece;
use crate::wire::request::{PieceRefusal, Request};

/// A way to robots.
pub trait RobotCarrier {
    /// Names of the robots that can be asked now, in order.
    fn robots(&mut self) -> Vec<String>;

    /// Asks a robot and hands over what it answers, piece by piece, until the answer ends, the way is
    /// cut, or `take` says enough with `false`. Nothing is promised: pieces may be missing, twice or of
    /// another sender.
    fn ask(
        &mut self,
        robot: &str,
        request: &Request,
        take: &mut dyn FnMut(Result<Piece, PieceRefusal>) -> bool,
    );
}
