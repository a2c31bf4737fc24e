//! KTX2 (Khronos "KTX File Format Specification" 2.0): one level of a 2D texture, uncompressed or in blocks.

use super::failed;
use crate::error::Result;
use std::io::Write;

/// What the texels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ktx2Format {
    /// Four channels of 8 bits, linear.
    Rgba8,
    /// Four channels of 16 bits, linear.
    Rgba16,
    /// BC5: two channels.
    Bc5,
    /// BC7, linear.
    Bc7,
}

/// A texture.
#[derive(Clone, Copy, Debug)]
pub struct Ktx2<'a> {
    /// Texels per row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// What the bytes are.
    pub format: Ktx2Format,
    /// The texels or blocks, row after row from the top.
    pub bytes: &'a [u8],
}

pub(super) fn write(out: &mut dyn Write, texture: &Ktx2) -> Result<()> {
    // Vulkan's number, bytes per number, colour model, texels along a block's side, bytes per block.
    let (number, each, model, side, block) = match texture.format {
        Ktx2Format::Rgba8 => (37u32, 1u32, 1u32, 1u32, 4u32),
        Ktx2Format::Rgba16 => (91, 2, 1, 1, 8),
        Ktx2Format::Bc5 => (141, 1, 132, 4, 16),
        Ktx2Format::Bc7 => (145, 1, 134, 4, 16),
    };
    // Where each channel's bits begin, how many, which channel, its largest number.
    let samples: Vec<(u32, u32, u32, u32)> = match texture.format {
        Ktx2Format::Rgba8 => [0, 1, 2, 15].iter().zip(0..).map(|(c, k)| (8 * k, 8, *c, 255)).collect(),
        Ktx2Format::Rgba16 => [0, 1, 2, 15].iter().zip(0..).map(|(c, k)| (16 * k, 16, *c, 65535)).collect(),
        Ktx2Format::Bc5 => vec![(0, 64, 0, u32::MAX), (64, 64, 1, u32::MAX)],
        Ktx2Format::Bc7 => vec![(0, 128, 0, u32::MAX)],
    };
    let mut dfd = Vec::new();
    let size = 24 + 16 * samples.len() as u32;
    let side = side - 1;
    // No primaries (it is data), linear transfer.
    for word in [size + 4, 0, 2 | size << 16, model | 1 << 16, side | side << 8, block, 0] {
        dfd.extend(word.to_le_bytes());
    }
    for (at, bits, channel, most) in samples {
        for word in [at | (bits - 1) << 16 | channel << 24, 0, 0, most] {
            dfd.extend(word.to_le_bytes());
        }
    }
    let mut notes = Vec::new();
    for note in
        [&b"KTXorientation\0rd\0"[..], concat!("KTXwriter\0frieze ", env!("CARGO_PKG_VERSION"), "\0").as_bytes()]
    {
        notes.extend((note.len() as u32).to_le_bytes());
        notes.extend(note);
        notes.resize(notes.len().next_multiple_of(4), 0);
    }
    let dfd_at = 80 + 24u32;
    let notes_at = dfd_at + dfd.len() as u32;
    let end = notes_at as usize + notes.len();
    let data_at = end.next_multiple_of(block.max(4) as usize);
    let mut head = b"\xabKTX 20\xbb\r\n\x1a\n".to_vec();
    // One level of one face of no array, not packed further.
    for word in [number, each, texture.width, texture.height, 0, 0, 1, 1, 0] {
        head.extend(word.to_le_bytes());
    }
    for word in [dfd_at, dfd.len() as u32, notes_at, notes.len() as u32] {
        head.extend(word.to_le_bytes());
    }
    for word in [0u64, 0, data_at as u64, texture.bytes.len() as u64, texture.bytes.len() as u64] {
        head.extend(word.to_le_bytes());
    }
    head.extend(dfd);
    head.extend(notes);
    head.resize(data_at, 0);
    out.write_all(&head).map_err(failed)?;
    out.write_all(texture.bytes).map_err(failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_says_where_everything_lies() {
        for (format, number, block) in
            [(Ktx2Format::Bc5, 141, 16), (Ktx2Format::Bc7, 145, 16), (Ktx2Format::Rgba8, 37, 4)]
        {
            let bytes: Vec<u8> = (0..64).collect();
            let mut file = Vec::new();
            write(&mut file, &Ktx2 { width: 8, height: 8, format, bytes: &bytes }).unwrap();
            let word = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
            assert_eq!(&file[..12], b"\xabKTX 20\xbb\r\n\x1a\n");
            assert_eq!((word(12), word(20), word(24), word(36), word(40)), (number, 8, 8, 1, 1));
            let (dfd, length) = (word(48), word(52));
            assert_eq!((dfd, word(dfd)), (104, length));
            // The block's size, less the total's word, and one sample of 16 bytes each.
            assert_eq!(word(dfd + 8) >> 16, length - 4);
            assert_eq!((word(56), file[word(56) + 4..].starts_with(b"KTXorientation\0rd\0")), (dfd + length, true));
            let data = word(80);
            assert!(data.is_multiple_of(block) && word(88) == 64);
            assert_eq!(&file[data..], bytes);
        }
    }
}
