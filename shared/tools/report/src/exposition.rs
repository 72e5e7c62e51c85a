//! Figures as Prometheus reads them (text format 0.0.4), asked for on this machine alone.

use crate::http::Answer;
use std::fmt::Write;
use std::net::SocketAddr;

/// Where Prometheus asks.
pub const METRICS_PATH: &str = "/metrics";

/// Figures of one moment.
#[derive(Clone, Debug, Default)]
pub struct Exposition(String);

impl Exposition {
    /// Begins the figures of a name: its kind (`counter`, `gauge`, `summary`) and what they mean.
    pub fn family(&mut self, name: &str, kind: &str, meaning: &str) {
        // Writing to a string does not fail.
        let _ = writeln!(self.0, "# HELP {name} {meaning}\n# TYPE {name} {kind}");
    }

    /// Adds a figure, named by pairs of label and value.
    pub fn sample(&mut self, name: &str, labels: &[(&str, &str)], value: f64) {
        let label = |(label, value): &(&str, &str)| format!("{label}=\"{}\"", escaped(value));
        let labels = labels.iter().map(label).collect::<Vec<_>>().join(",");
        let labels = if labels.is_empty() { labels } else { format!("{{{labels}}}") };
        let _ = writeln!(self.0, "{name}{labels} {value}");
    }

    /// All of it.
    pub fn text(&self) -> &str {
        &self.0
    }
}

impl From<Exposition> for Answer {
    fn from(figures: Exposition) -> Self {
        let head = "Content-Type: text/plain; version=0.0.4\r\n".into();
        Self { status: "200 OK", head, body: figures.0.into() }
    }
}

/// A label's value, in which quotes, backslashes and ends of lines are told.
fn escaped(value: &str) -> String {
    value.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

/// Reads an address of the loopback interface, as `127.0.0.1:9464`.
///
/// # Errors
/// Where it is none, in words for whoever gave it.
pub fn loopback_address(text: &str) -> Result<SocketAddr, String> {
    match text.parse::<SocketAddr>() {
        Ok(address) if address.ip().is_loopback() => Ok(address),
        Ok(address) => Err(format!("{} is not of this machine alone, expected 127.0.0.1:PORT", address.ip())),
        Err(_) => Err("expected 127.0.0.1:PORT".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_of_labels_cannot_end_their_line() {
        let mut figures = Exposition::default();
        figures.family("a_total", "counter", "All.");
        figures.sample("a_total", &[("robot", "a\"} 7\nb\\"), ("run", "one")], 2.0);
        figures.sample("a_total", &[], 0.5);
        assert_eq!(
            figures.text(),
            "# HELP a_total All.\n# TYPE a_total counter\n\
             a_total{robot=\"a\\\"} 7\\nb\\\\\",run=\"one\"} 2\na_total 0.5\n"
        );
    }

    #[test]
    fn an_address_is_of_this_machine() {
        assert!(loopback_address("127.0.0.1:9464").is_ok() && loopback_address("[::1]:0").is_ok());
        for wrong in ["0.0.0.0:1", "192.168.0.2:9464", "9464", "localhost:1", ""] {
            assert!(loopback_address(wrong).is_err(), "{wrong}");
        }
    }
}
