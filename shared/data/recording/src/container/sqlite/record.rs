//! A row as SQLite stores it: a head of serial types, then the values.
//!
//! Source: sqlite.org/fileformat2.html, section 2.1.

/// Values of columns that matter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// NULL, or a number that is no integer.
    Other,
    Integer(i64),
    Text(String),
    /// Bytes from `start` of the payload, `len` of them.
    Blob {
        start: u64,
        len: u64,
    },
}

/// A variable-length integer; answers it and its bytes. `None`: it is torn.
pub(super) fn varint(bytes: &[u8]) -> Option<(u64, usize)> {
    let mut value = 0_u64;
    for (at, &byte) in bytes.iter().take(9).enumerate() {
        if at == 8 {
            return Some((value << 8 | u64::from(byte), 9));
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            return Some((value, at.saturating_add(1)));
        }
    }
    None
}

/// The values of a row from the front of its payload, up to the first that is not whole in there; a
/// blob is described and not copied. `None`: the head is torn.
pub(super) fn values(front: &[u8]) -> Option<Vec<Value>> {
    let (n_head, mut at) = varint(front)?;
    let head = front.get(..usize::try_from(n_head).ok()?)?;
    let mut start = n_head;
    let mut values = Vec::new();
    while at < head.len() {
        let (kind, n) = varint(head.get(at..)?)?;
        at = at.saturating_add(n);
        let len = match kind {
            0..=4 => kind,
            5 => 6,
            6 | 7 => 8,
            8..=11 => 0,
            _ => kind.saturating_sub(12) / 2,
        };
        let end = start.checked_add(len)?;
        let is_blob = kind >= 12 && kind % 2 == 0;
        if is_blob {
            values.push(Value::Blob { start, len });
        } else {
            let bytes = usize::try_from(start).ok().zip(usize::try_from(end).ok());
            let Some(bytes) = bytes.and_then(|(start, end)| front.get(start..end)) else { break };
            values.push(value(kind, bytes));
        }
        start = end;
    }
    Some(values)
}

fn value(kind: u64, bytes: &[u8]) -> Value {
    match kind {
        1..=6 => {
            let is_negative = bytes.first().is_some_and(|byte| byte & 0x80 != 0);
            let sign = if is_negative { -1_i64 } else { 0 };
            Value::Integer(bytes.iter().fold(sign, |value, &byte| value << 8 | i64::from(byte)))
        }
        8 => Value::Integer(0),
        9 => Value::Integer(1),
        kind if kind >= 13 => Value::Text(String::from_utf8_lossy(bytes).into_owned()),
        _ => Value::Other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_of_any_length_are_read() {
        assert_eq!(varint(&[0x05]), Some((5, 1)));
        assert_eq!(varint(&[0x81, 0x00]), Some((128, 2)));
        assert_eq!(varint(&[0xff; 9]), Some((u64::MAX, 9)));
        assert_eq!((varint(&[0x80]), varint(&[])), (None, None));
    }

    #[test]
    fn a_row_is_read_and_its_blob_only_described() {
        // NULL, -2 in two bytes, 1, 'ab', a blob of three bytes that are not there.
        let row = [6, 0, 2, 9, 17, 18, 0xff, 0xfe, b'a', b'b'];
        let expected = [
            Value::Other,
            Value::Integer(-2),
            Value::Integer(1),
            Value::Text("ab".into()),
            Value::Blob { start: 10, len: 3 },
        ];
        assert_eq!(values(&row).unwrap(), expected);
        // The text is not whole.
        assert_eq!(values(&row[..9]).unwrap().len(), 3);
        assert_eq!(values(&row[..4]), None);
    }
}
