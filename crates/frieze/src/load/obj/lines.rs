//! The lines of an OBJ file, read in parallel pieces. A piece does not know how many vertices came before it, so
//! negative indices wait in a list until all pieces are counted.

use crate::error::{Error, Result};
use crate::load::text::{Cursor, line_of, text};

/// Bytes of a piece, up to the end of a line.
pub const PIECE: usize = 1 << 18;

/// No index.
pub const NONE: u32 = u32::MAX;

/// A statement that concerns the faces after it.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    Object(String),
    Group(String),
    UseMaterial(String),
    MaterialFiles(String),
    /// 0 is flat.
    Smooth(u32),
    /// A statement that is not understood, and its line in the piece.
    Ignored(String, usize),
}

/// What a piece of the file holds.
#[derive(Debug, Default)]
pub struct Piece {
    pub positions: Vec<[f32; 3]>,
    /// As long as `positions`, or empty. Linear RGBA; white where the file gives none.
    pub colors: Vec<[f32; 4]>,
    pub uv: Vec<[f32; 2]>,
    pub normals: Vec<[f32; 3]>,
    /// Position, texture and normal index of each corner, from 0; [`NONE`] where the face has none.
    pub corners: [Vec<u32>; 3],
    /// Corners of each face.
    pub sizes: Vec<u32>,
    /// Corner, which index, and value relative to the piece's beginning, of negative indices.
    pub relative: Vec<(u32, u8, i64)>,
    /// Statements, each with the number of faces of the piece before it.
    pub events: Vec<(u32, Event)>,
    /// Faces of less than three corners that were left out.
    pub short: u32,
}

impl Piece {
    /// Bytes that it holds.
    pub fn bytes(&self) -> u64 {
        let corners: usize = self.corners.iter().map(|c| c.capacity() * 4).sum();
        (self.positions.capacity() * 12
            + self.colors.capacity() * 16
            + self.uv.capacity() * 8
            + self.normals.capacity() * 12
            + corners
            + self.sizes.capacity() * 4
            + self.relative.capacity() * 16
            + self.events.capacity() * 48) as u64
    }
}

/// Ends of pieces: behind line ends that no backslash continues.
pub fn pieces(bytes: &[u8]) -> Vec<&[u8]> {
    let mut list = Vec::with_capacity(bytes.len() / PIECE + 1);
    let mut rest = bytes;
    while rest.len() > PIECE {
        let mut end = PIECE;
        loop {
            end = rest[end..].iter().position(|&b| b == b'\n').map_or(rest.len(), |k| end + k + 1);
            let line = rest[..end].strip_suffix(b"\n").unwrap_or_default();
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            if end == rest.len() || !line.ends_with(b"\\") {
                break;
            }
        }
        let (piece, others) = rest.split_at(end);
        list.push(piece);
        rest = others;
    }
    list.push(rest);
    list
}

/// Reads a piece.
///
/// # Errors
/// `obj.number`, `obj.index`, `mesh.not-finite`, with the line within the piece as `place` (digits only).
pub fn read(bytes: &[u8]) -> Result<Piece> {
    let mut p = Piece::default();
    let mut c = Cursor::new(bytes);
    while !c.is_done() {
        if c.is_line_end() {
            if c.peek() == b'\r' {
                // A lone carriage return ends a line too.
                c.at += 1;
            } else {
                c.next_line();
            }
            continue;
        }
        let begin = c.at;
        match c.word() {
            b"v" => vertex(&mut p, &mut c).map_err(|e| e.at(line_of(bytes, begin).to_string()))?,
            b"vt" => {
                let u = number(&mut c, "vt").map_err(|e| e.at(line_of(bytes, begin).to_string()))?;
                let v = c.float().unwrap_or(0.0);
                p.uv.push([u, 1.0 - v]);
            }
            b"vn" => {
                let mut n = [0.0; 3];
                for v in &mut n {
                    *v = number(&mut c, "vn").map_err(|e| e.at(line_of(bytes, begin).to_string()))?;
                }
                p.normals.push(n);
            }
            b"f" | b"fo" => face(&mut p, &mut c).map_err(|e| e.at(line_of(bytes, begin).to_string()))?,
            word => {
                let event = match word {
                    b"o" => Event::Object(text(c.rest())),
                    b"g" => Event::Group(text(c.rest())),
                    b"usemtl" => Event::UseMaterial(text(c.rest())),
                    b"mtllib" => Event::MaterialFiles(text(c.rest())),
                    b"s" => match c.rest() {
                        b"off" => Event::Smooth(0),
                        rest => Event::Smooth(text(rest).parse().unwrap_or(1)),
                    },
                    word => {
                        let word = text(&word[..word.len().min(20)]);
                        c.next_line();
                        let known = |e: &(u32, Event)| matches!(&e.1, Event::Ignored(w, _) if *w == word);
                        if p.events.len() < 1000 && !p.events.iter().any(known) {
                            let line = line_of(bytes, begin);
                            p.events.push((p.sizes.len() as u32, Event::Ignored(word, line)));
                        }
                        continue;
                    }
                };
                p.events.push((p.sizes.len() as u32, event));
                continue;
            }
        }
        while !matches!(c.peek(), b'\n' | b'\r') {
            c.at += 1;
        }
    }
    Ok(p)
}

#[inline(always)]
fn number(c: &mut Cursor<'_>, what: &str) -> Result<f32> {
    c.float().ok_or_else(|| Error::input("obj.number", format!("{what} is not followed by its numbers")))
}

#[inline(always)]
fn vertex(p: &mut Piece, c: &mut Cursor<'_>) -> Result<()> {
    let mut v = [0.0; 3];
    for v in &mut v {
        *v = number(c, "v")?;
    }
    if !v.iter().all(|v| v.is_finite()) {
        let message = format!("the position v {} {} {} is not finite", v[0], v[1], v[2]);
        return Err(Error::input("mesh.not-finite", message).remedy("the model is broken there; remove the vertex"));
    }
    p.positions.push(v);
    if c.is_line_end() {
        if !p.colors.is_empty() {
            p.colors.push([1.0; 4]);
        }
        return Ok(());
    }
    // One more number is a weight. Three or four are a colour; so are the last three of a weight and a colour.
    let mut more = [0.0; 4];
    let mut n = 0;
    while n < 4
        && let Some(v) = c.float()
    {
        more[n] = v;
        n += 1;
    }
    if n >= 3 {
        let white = [1.0; 4];
        p.colors.resize(p.positions.len() - 1, white);
        let alpha = if n == 4 { more[3] } else { 1.0 };
        let rgba = [more[0], more[1], more[2], alpha];
        p.colors.push(rgba.map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 }));
    } else if !p.colors.is_empty() {
        p.colors.push([1.0; 4]);
    }
    Ok(())
}

#[inline(always)]
fn face(p: &mut Piece, c: &mut Cursor<'_>) -> Result<()> {
    let first = p.corners[0].len();
    let known = p.relative.len();
    let counts = [p.positions.len(), p.uv.len(), p.normals.len()];
    while !c.is_line_end() {
        let mut index = [0i64; 3];
        let bad = || {
            Error::input("obj.index", "a corner of the face is no index; a corner is written v, v/vt, v//vn or v/vt/vn")
        };
        index[0] = c.integer().ok_or_else(bad)?;
        for index in &mut index[1..] {
            if c.peek() != b'/' {
                break;
            }
            c.at += 1;
            *index = match c.integer() {
                Some(k) => k,
                None if matches!(c.peek(), b'/' | b' ' | b'\t' | b'\r' | b'\n') => 0,
                None => return Err(bad()),
            };
        }
        if !matches!(c.peek(), b' ' | b'\t' | b'\r' | b'\n' | b'#' | b'\\') {
            return Err(bad());
        }
        let corner = p.corners[0].len() as u32;
        for k in 0..3 {
            p.corners[k].push(match index[k] {
                // Too large ones are found out of range later, as any other.
                i @ 1.. => u32::try_from(i - 1).unwrap_or(NONE - 1).min(NONE - 1),
                0 if k == 0 => return Err(Error::input("obj.index", "the face has index 0; indices begin at 1")),
                0 => NONE,
                i => {
                    p.relative.push((corner, k as u8, counts[k] as i64 + i));
                    0
                }
            });
        }
    }
    let size = p.corners[0].len() - first;
    if size < 3 {
        p.corners.iter_mut().for_each(|c| c.truncate(first));
        p.relative.truncate(known);
        p.short += 1;
    } else {
        p.sizes.push(size as u32);
    }
    Ok(())
}

/// The line within a piece of its face `k`.
pub fn line_of_face(bytes: &[u8], k: usize) -> usize {
    let mut c = Cursor::new(bytes);
    let mut left = k + 1;
    while !c.is_done() {
        c.skip_blanks();
        let begin = c.at;
        if matches!(c.word(), b"f" | b"fo") {
            let mut one = Piece::default();
            if face(&mut one, &mut c).is_ok() && one.short == 0 {
                left -= 1;
                if left == 0 {
                    return line_of(bytes, begin);
                }
            }
        }
        c.next_line();
    }
    line_of(bytes, bytes.len())
}
