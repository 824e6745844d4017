//! PNG files of any kind, uncompressed.

/// A PNG with the chunks `more` before the pixels. `pixels` are rows of equal length.
pub fn encode(
    (width, height): (usize, usize),
    bit_depth: u8,
    colour_type: u8,
    more: &[(&[u8; 4], &[u8])],
    pixels: &[u8],
) -> Vec<u8> {
    let size = [width, height].map(|side| (side as u32).to_be_bytes()).concat();
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    chunk(&mut file, b"IHDR", &[&size[..], &[bit_depth, colour_type, 0, 0, 0]].concat());
    for (kind, data) in more {
        chunk(&mut file, kind, data);
    }
    // Filter 0 before every row; one stored deflate block in a zlib stream.
    let raw: Vec<u8> = pixels.chunks(pixels.len() / height).flat_map(|row| [&[0], row].concat()).collect();
    let length = u16::try_from(raw.len()).expect("a small image");
    let mut zlib = vec![0x78, 0x01, 1];
    zlib.extend(length.to_le_bytes());
    zlib.extend((!length).to_le_bytes());
    zlib.extend(&raw);
    let (a, b) = raw.iter().fold((1u32, 0u32), |(a, b), &v| {
        let a = (a + u32::from(v)) % 65521;
        (a, (b + a) % 65521)
    });
    zlib.extend((b << 16 | a).to_be_bytes());
    chunk(&mut file, b"IDAT", &zlib);
    chunk(&mut file, b"IEND", &[]);
    file
}

fn chunk(file: &mut Vec<u8>, kind: &[u8; 4], data: &[u8]) {
    file.extend((data.len() as u32).to_be_bytes());
    let body = [kind, data].concat();
    let crc = !body.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| if c & 1 == 1 { c >> 1 ^ 0xEDB8_8320 } else { c >> 1 })
    });
    file.extend(body);
    file.extend(crc.to_be_bytes());
}
