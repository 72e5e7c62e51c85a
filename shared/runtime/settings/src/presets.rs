//! The presets, built in.

/// Name and text of each preset; a preset holds what differs from the default and why.
pub const PRESETS: [(&str, &str); 4] = [
    ("default", include_str!("../../../../config/default.toml")),
    ("paper", include_str!("../../../../config/paper.toml")),
    ("fast", include_str!("../../../../config/fast.toml")),
    ("onboard", include_str!("../../../../config/onboard.toml")),
];

/// The text of the preset `name`.
pub fn preset(name: &str) -> Option<&'static str> {
    PRESETS.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
