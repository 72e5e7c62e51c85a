use super::*;
use crate::SplitMix64;

fn numbers() -> Vec<i32> {
    let mut random = SplitMix64::new(3);
    let edges = [0, 1, -1, 3, 4, 5, 6, 7, 8, -9, 12, i32::MAX, i32::MIN, i32::MIN + 1];
    let spread = (0..3000).map(|k| random.next_u64() as i32 >> (k % 32));
    edges.into_iter().chain(spread).collect()
}

fn written(numbers: &[i32]) -> Vec<u8> {
    let (mut writer, mut model) = (RangeWriter::default(), NumberModel::default());
    numbers.iter().for_each(|&number| _ = model.signed(&mut writer, number));
    writer.finish()
}

fn read(bytes: &[u8], n: usize) -> (Vec<i32>, bool) {
    let (mut reader, mut model) = (RangeReader::new(bytes), NumberModel::default());
    let numbers = (0..n).map(|_| model.signed(&mut reader, 0)).collect();
    (numbers, reader.ends())
}

#[test]
fn numbers_come_back() {
    let numbers = numbers();
    for n in (0..200).chain([numbers.len()]) {
        assert_eq!(read(&written(&numbers[..n]), n), (numbers[..n].to_vec(), true), "{n} numbers");
    }
    for magnitude in [0, 1, 4, 1 << 31, u32::MAX] {
        let (mut writer, mut model) = (RangeWriter::default(), NumberModel::default());
        assert_eq!(model.magnitude(&mut writer, magnitude), magnitude);
        let bytes = writer.finish();
        assert_eq!(NumberModel::default().magnitude(&mut RangeReader::new(&bytes), 0), magnitude);
    }
}

#[test]
fn bits_cost_what_they_tell() {
    let mut random = SplitMix64::new(5);
    let (mut writer, mut model) = (RangeWriter::default(), BitModel::default());
    // One in ten: 0.469 bits each.
    (0..80_000).for_each(|_| _ = writer.bit(&mut model, random.below(10) == 0));
    let n_bytes = writer.finish().len();
    assert!((4690..4840).contains(&n_bytes), "{n_bytes} bytes");
}

#[test]
fn other_bytes_give_numbers_and_are_told_from_written_ones() {
    let numbers = &numbers()[..500];
    let bytes = written(numbers);
    assert!(!read(&bytes[..bytes.len() - 1], 500).1);
    assert!(!read(&[bytes.as_slice(), &[0]].concat(), 500).1);
    assert!(!read(&[], 500).1 && !read(&[255; 4000], 500).1 && !read(&[0; 4000], 500).1);
}

/// Bytes by how many of their bits are 1, each with probability 11 / 64.
fn byte_parts() -> ByteParts {
    let mut shares = [0; 256];
    for (byte, share) in shares.iter_mut().enumerate() {
        let n_ones = byte.count_ones();
        *share = ((11_u64.pow(n_ones) * 53_u64.pow(8 - n_ones)) >> 32).max(1) as u32;
    }
    shares[0] = 0;
    ByteParts::new(&shares)
}

#[test]
fn parts_come_back_and_cost_what_they_tell() {
    let (parts, mut random) = (byte_parts(), SplitMix64::new(7));
    let mut byte = || (0..8).fold(0, |byte, _| byte << 1 | u32::from(random.below(64) < 11));
    let bytes: Vec<u32> = (0..255).chain((0..10_000).map(|_| byte())).collect();
    let mut writer = RangeWriter::default();
    for (at, &byte) in bytes.iter().enumerate() {
        writer.part(&parts, byte);
        writer.plain(byte * 0x0101_0101, at as u32 % 33);
    }
    let (mut plain, mut alone) = (RangeWriter::default(), RangeWriter::default());
    let written = writer.finish();
    let mut reader = RangeReader::new(&written);
    for (at, &byte) in bytes.iter().enumerate() {
        assert_eq!(reader.part(&parts, 0), byte);
        let n = at as u32 % 33;
        let low = u64::from(byte * 0x0101_0101) & ((1_u64 << n) - 1);
        assert_eq!(reader.plain(0, n), low as u32, "{n} bits");
    }
    assert!(reader.ends());
    bytes[255..].iter().for_each(|&byte| _ = (alone.part(&parts, byte), plain.plain(byte, 8)));
    // 0.662 bits each.
    let [alone, plain] = [alone, plain].map(|writer| writer.finish().len());
    assert!((6600..6750).contains(&alone), "{alone} bytes");
    assert!((10_000..10_010).contains(&plain), "{plain} bytes");
}

/// A range whose ends stay on both sides of a border becomes too narrow to be parted.
#[test]
fn a_narrow_range_tells_values_all_the_same() {
    let parts = byte_parts();
    for width in [1, 2, 100, 65_535, 65_536, 1 << 20] {
        let (low, high) = ((1 << 63) - 1 - width / 2, (1 << 63) + width / 2);
        let mut writer = RangeWriter { low, high, bytes: Vec::new() };
        (0..200).for_each(|value| _ = (writer.part(&parts, value), writer.plain(value, 13)));
        let bytes = writer.finish();
        let mut reader = RangeReader { low, high, ..RangeReader::new(&bytes) };
        for value in 0..200 {
            assert_eq!((reader.part(&parts, 0), reader.plain(0, 13)), (value, value), "width {width}");
        }
        assert!(reader.ends());
    }
}

#[test]
#[should_panic(expected = "shares of 65,536")]
fn shares_of_more_than_all_are_none() {
    ByteParts::new(&[300; 256]);
}
