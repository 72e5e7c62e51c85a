//! The four stages by name.

/// One of the four processes that a frame passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stage {
    /// Reads frames and writes them into shared memory.
    Sensor,
    /// Makes a surface of each frame.
    Reconstruct,
    /// Aligns each surface to the map; owns the poses and the keyframes.
    Align,
    /// Optimises all keyframes.
    Optimise,
}

impl Stage {
    /// All stages in the order of the flow.
    pub const ALL: [Stage; 4] = [Stage::Sensor, Stage::Reconstruct, Stage::Align, Stage::Optimise];

    /// Name on the command line, in logs and in file names.
    pub fn name(self) -> &'static str {
        match self {
            Stage::Sensor => "sensor",
            Stage::Reconstruct => "reconstruct",
            Stage::Align => "align",
            Stage::Optimise => "optimise",
        }
    }

    /// The stage of that name.
    pub fn from_name(name: &str) -> Option<Stage> {
        Stage::ALL.into_iter().find(|stage| stage.name() == name)
    }

    /// Position in [`Stage::ALL`], as it is written in messages.
    pub fn number(self) -> u32 {
        self as u32
    }

    /// The stage at that position, where there is one.
    pub fn from_number(number: u32) -> Option<Stage> {
        Stage::ALL.into_iter().find(|stage| stage.number() == number)
    }
}

impl std::fmt::Display for Stage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}
