//! Recordings with compressed chunks, made of such as are not compressed.

use std::io::{Read, Write};

const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
const FOOTER: u8 = 0x02;
const CHUNK: u8 = 0x06;
const MESSAGE_INDEX: u8 = 0x07;
const DATA_END: u8 = 0x0f;
/// Of a chunk's record before the name of its compression.
const HEAD: usize = 28;
/// The lengths of no name and of the records.
const LENGTHS: usize = 12;

/// Copies a recording record by record and compresses its chunks with `zstd` or `lz4`. It has no
/// indexes and no summary.
pub(crate) fn compress(mut from: impl Read, mut to: impl Write, name: &str) {
    let mut magic = [0; 8];
    from.read_exact(&mut magic).unwrap();
    assert_eq!(&magic, MAGIC);
    to.write_all(MAGIC).unwrap();
    let mut framing = [0; 9];
    loop {
        from.read_exact(&mut framing).unwrap();
        let [opcode, length @ ..] = framing;
        let mut body = vec![0; u64::from_le_bytes(length) as usize];
        from.read_exact(&mut body).unwrap();
        match opcode {
            CHUNK => {
                let records = packed(&body[HEAD + LENGTHS..], name);
                let (n_name, n_records) = (name.len() as u32, records.len() as u64);
                let (n_name, n_records) = (n_name.to_le_bytes(), n_records.to_le_bytes());
                write(&mut to, CHUNK, &[&body[..HEAD], &n_name, name.as_bytes(), &n_records, &records]);
            }
            MESSAGE_INDEX => {}
            DATA_END => break write(&mut to, DATA_END, &[&[0; 4]]),
            _ => write(&mut to, opcode, &[&body]),
        }
    }
    write(&mut to, FOOTER, &[&[0; 20]]);
    to.write_all(MAGIC).unwrap();
    to.flush().unwrap();
}

fn packed(records: &[u8], name: &str) -> Vec<u8> {
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};
    match name {
        "zstd" => {
            // Two frames and one to be passed over, as the format has it.
            let (a, b) = records.split_at(records.len() / 2);
            let level = CompressionLevel::Fastest;
            let skipped = [&0x184d_2a50u32.to_le_bytes()[..], &3u32.to_le_bytes(), b"abc"].concat();
            [compress_to_vec(a, level), skipped, compress_to_vec(b, level)].concat()
        }
        _ => {
            let mut encoder = lz4_flex::frame::FrameEncoder::new(Vec::new());
            encoder.write_all(records).unwrap();
            encoder.finish().unwrap()
        }
    }
}

fn write(to: &mut impl Write, opcode: u8, parts: &[&[u8]]) {
    let length: usize = parts.iter().map(|part| part.len()).sum();
    to.write_all(&[opcode]).unwrap();
    to.write_all(&(length as u64).to_le_bytes()).unwrap();
    parts.iter().for_each(|part| to.write_all(part).unwrap());
}
