//! The text of a file as other programs and other systems write it.

const UTF8_MARK: &[u8] = &[0xef, 0xbb, 0xbf];
const UTF16_LITTLE_MARK: &[u8] = &[0xff, 0xfe];
const UTF16_BIG_MARK: &[u8] = &[0xfe, 0xff];
/// Digits of whole nanoseconds since 1970.
pub(crate) const WHOLE_DIGITS: usize = 14;
/// What separates the columns of a row.
pub(crate) const SEPARATORS: [char; 4] = [' ', '\t', ',', ';'];

/// The text of some bytes: UTF-8, or UTF-16 where its mark says so; without the mark, and each line ended by
/// a line feed.
pub fn plain_text(bytes: &[u8]) -> String {
    let wide = |rest: &[u8], value: fn([u8; 2]) -> u16| {
        let values: Vec<u16> = rest.as_chunks().0.iter().map(|pair| value(*pair)).collect();
        String::from_utf16_lossy(&values)
    };
    let text = if let Some(rest) = bytes.strip_prefix(UTF16_LITTLE_MARK) {
        wide(rest, u16::from_le_bytes)
    } else if let Some(rest) = bytes.strip_prefix(UTF16_BIG_MARK) {
        wide(rest, u16::from_be_bytes)
    } else {
        String::from_utf8_lossy(bytes.strip_prefix(UTF8_MARK).unwrap_or(bytes)).into_owned()
    };
    match text.contains('\r') {
        true => text.replace("\r\n", "\n").replace('\r', "\n"),
        false => text,
    }
}

/// Whether a word is a whole number of nanoseconds since 1970.
pub(crate) fn is_whole_nanos(word: &str) -> bool {
    word.len() >= WHOLE_DIGITS && word.bytes().all(|byte| byte.is_ascii_digit())
}

/// The columns of a row.
pub(crate) fn columns(line: &str) -> Vec<&str> {
    line.split(SEPARATORS).filter(|word| !word.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_text_in_each_coding_and_with_each_end_of_line() {
        let text = "1.5 tiefe/ü.png\n2.5 b.png\n";
        let wide = |value: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(value).collect::<Vec<u8>>();
        let table = [
            text.as_bytes().to_vec(),
            [UTF8_MARK, text.as_bytes()].concat(),
            [UTF16_LITTLE_MARK, &wide(u16::to_le_bytes)].concat(),
            [UTF16_BIG_MARK, &wide(u16::to_be_bytes)].concat(),
            text.replace('\n', "\r\n").into_bytes(),
            text.replace('\n', "\r").into_bytes(),
        ];
        for bytes in table {
            assert_eq!(plain_text(&bytes), text, "{bytes:?}");
        }
        assert_eq!(plain_text(b"\xff"), "\u{fffd}");
        assert_eq!(columns("1,2; 3\t4 "), ["1", "2", "3", "4"]);
    }
}
