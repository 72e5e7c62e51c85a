//! Errors of settings.

/// Why settings were refused; the message names the key, where it stands and what must hold.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// The file cannot be read.
    #[error("{path}: cannot read the configuration: {reason} (presets are {presets})")]
    Read {
        /// As given.
        path: String,
        /// The system's words.
        reason: String,
        /// What could have been given instead.
        presets: String,
    },
    /// Not TOML.
    #[error("{origin}: not valid TOML: {reason}")]
    Syntax {
        /// File, line or argument.
        origin: String,
        /// The parser's words.
        reason: String,
    },
    /// A key that no part of Tessera reads.
    #[error("{origin}: unknown key `{key}`{hint}")]
    UnknownKey {
        /// File and line, or argument.
        origin: String,
        /// Full path of the key.
        key: String,
        /// The nearest known key, as words; empty where none is near.
        hint: String,
    },
    /// A value of another type.
    #[error("{origin}: `{key}` is {found}, expected {expected}")]
    Type {
        /// File and line, or argument.
        origin: String,
        /// Full path of the key.
        key: String,
        /// What stands there.
        found: String,
        /// The type expected.
        expected: String,
    },
    /// A word outside those allowed.
    #[error("configuration: {reason}")]
    Word {
        /// The deserialiser's message, which names the word, those allowed and the key.
        reason: String,
    },
    /// A value outside its range.
    #[error("configuration: {reason}")]
    Value {
        /// `path.of.key is value, expected rule`.
        reason: String,
    },
    /// `--set` without `=`.
    #[error("--set {argument}: expected key=value, for instance --set run.live=true")]
    NotAPair {
        /// As given.
        argument: String,
    },
    /// Settings that cannot be written.
    #[error("cannot write the configuration: {reason}")]
    Write {
        /// The serialiser's words.
        reason: String,
    },
}
