//! Addresses of the inputs and outputs of an algorithm, looked up for a test.
//!
//! A message that is read in place lies in a file of `/dev/shm` that is mapped; a copy lies on the
//! heap. Nothing is asked unless the environment says so.

/// Environment variable that makes each stage say where its inputs and outputs lie.
pub const PROBE_VARIABLE: &str = "TESSERA_PROBE";

/// How a log line about a place begins; behind it the name of the slice and its file.
pub const PROBED: &str = "lies in";

/// Looks up addresses in `/proc/self/maps`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Probe {
    is_on: bool,
}

impl Probe {
    /// The probe that the environment asks for.
    pub fn from_environment() -> Self {
        Self { is_on: std::env::var_os(PROBE_VARIABLE).is_some() }
    }

    /// Logs the mapped file that holds a slice of frame `index`.
    pub fn log_place<T>(&self, what: &str, index: u64, slice: &[T]) {
        if !self.is_on {
            return;
        }
        let from = slice.as_ptr() as usize;
        let maps = std::fs::read_to_string("/proc/self/maps").unwrap_or_default();
        let place = file_of(&maps, from, from.saturating_add(size_of_val(slice)));
        tracing::info!(frame = index, "{what} {PROBED} {}", place.unwrap_or("memory of its own"));
    }
}

/// The file whose mapping holds all of an address range.
fn file_of(maps: &str, from: usize, to: usize) -> Option<&str> {
    maps.lines().find_map(|line| {
        // `7f00-7f10 rw-s 00000000 00:19 4711    /dev/shm/name`
        let (range, rest) = line.split_once(' ')?;
        let (begin, end) = range.split_once('-')?;
        let number = |text| usize::from_str_radix(text, 16).ok();
        let holds = number(begin)? <= from && to <= number(end)?;
        holds.then(|| rest.find('/').and_then(|at| rest.get(at..)))?
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_range_that_lies_whole_in_a_file_has_one() {
        let maps = "1000-3000 rw-s 00000000 00:19 7   /dev/shm/a\n3000-5000 rw-p 00000000 00:00 0   [heap]\n";
        assert_eq!(file_of(maps, 0x1000, 0x3000), Some("/dev/shm/a"));
        assert_eq!(file_of(maps, 0x2000, 0x3001), None);
        assert_eq!(file_of(maps, 0x3000, 0x3010), None);
        assert_eq!(file_of(maps, 0x9000, 0x9010), None);
    }
}
