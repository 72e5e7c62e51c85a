//! Look-ups of many keys at once, where keys and entries rise.

/// The values of these keys, which rise, among entries that rise.
pub(crate) fn values_of<'a, K: Ord + 'a, V: 'a>(
    keys: impl Iterator<Item = K>,
    entries: impl Iterator<Item = (&'a K, &'a V)>,
) -> impl Iterator<Item = Option<&'a V>> {
    let mut entries = entries.peekable();
    keys.map(move |key| {
        while entries.next_if(|(other, _)| **other < key).is_some() {}
        entries.peek().filter(|(other, _)| **other == key).map(|(_, value)| *value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_found_for_keys_that_rise() {
        let entries = [(1, 'a'), (3, 'b'), (4, 'c')];
        let found = |keys: &[i32]| -> Vec<Option<char>> {
            let entries = entries.iter().map(|(key, value)| (key, value));
            values_of(keys.iter().copied(), entries).map(Option::<&char>::copied).collect()
        };
        assert_eq!(found(&[0, 1, 2, 3, 3, 9]), [None, Some('a'), None, Some('b'), Some('b'), None]);
        assert_eq!(found(&[]), []);
    }
}
