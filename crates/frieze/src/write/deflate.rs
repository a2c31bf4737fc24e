//! A fast Deflate encoder (RFC 1951) for the rows of a PNG: one greedy search through a small hash table,
//! then one dynamic Huffman block per call. It reads nothing but its input, so bands of rows compress side
//! by side and the bytes depend on no thread. About three times as fast as level 1 of general encoders.

/// Longest code of the literal and length alphabet: four literals fit one flush of the bit buffer.
const LONGEST: usize = 12;
const HASH_BITS: u32 = 14;
const MIN_MATCH: usize = 4;
const MAX_MATCH: usize = 258;
const WINDOW: usize = 32768;

/// A run of literals and the match after it (length 0: none).
struct Step {
    literals: u32,
    length: u16,
    distance: u16,
}

/// Compresses `data` into blocks that are not final, ending on a byte boundary (an empty stored block, as
/// zlib's sync flush), so that results may be put one after the other.
pub(super) fn blocks(data: &[u8]) -> Vec<u8> {
    let steps = search(data);
    let coded = huffman(data, &steps);
    // Five bytes of header per stored block.
    let stored = data.len() + 5 * data.len().div_ceil(65535);
    if coded.len() < stored { coded } else { store(data, stored) }
}

fn store(data: &[u8], size: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(size);
    for part in data.chunks(65535) {
        let n = part.len() as u16;
        out.push(0);
        out.extend(n.to_le_bytes());
        out.extend((!n).to_le_bytes());
        out.extend(part);
    }
    out
}

fn load32(data: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(data[at..at + 4].try_into().expect("four bytes"))
}

fn load64(data: &[u8], at: usize) -> u64 {
    u64::from_le_bytes(data[at..at + 8].try_into().expect("eight bytes"))
}

/// How many bytes from `a` and `b` on are equal, at most `most`.
fn equal(data: &[u8], a: usize, b: usize, most: usize) -> usize {
    let mut n = 0;
    while n + 8 <= most {
        let x = load64(data, a + n) ^ load64(data, b + n);
        if x != 0 {
            return n + x.trailing_zeros() as usize / 8;
        }
        n += 8;
    }
    while n < most && data[a + n] == data[b + n] {
        n += 1;
    }
    n
}

/// Greedy matches. Where none are found the search strides ever faster, as LZ4's does.
fn search(data: &[u8]) -> Vec<Step> {
    let mut steps = Vec::with_capacity(data.len() / 16 + 1);
    let mut table = vec![0u32; 1 << HASH_BITS]; // positions + 1
    let (mut at, mut begin, mut misses) = (1usize, 0usize, 0usize);
    while at + 8 <= data.len() {
        let word = load32(data, at);
        // The byte before, repeated: flat areas, found without the table.
        let (mut length, mut from) = (0, 0);
        if word == load32(data, at - 1) {
            from = at - 1;
            length = equal(data, at, from, MAX_MATCH.min(data.len() - at));
        } else {
            let slot = &mut table[(word.wrapping_mul(0x9e37_79b1) >> (32 - HASH_BITS)) as usize];
            let candidate = *slot as usize;
            *slot = at as u32 + 1;
            if candidate > 0 && at + 1 - candidate <= WINDOW && load32(data, candidate - 1) == word {
                from = candidate - 1;
                length = equal(data, at, from, MAX_MATCH.min(data.len() - at));
            }
        }
        // A far match of a few bytes costs more bits than its literals.
        let worth = match at - from {
            0..=256 => MIN_MATCH,
            257..=4096 => MIN_MATCH + 1,
            _ => MIN_MATCH + 2,
        };
        if length >= worth {
            steps.push(Step { literals: (at - begin) as u32, length: length as u16, distance: (at - from - 1) as u16 });
            at += length;
            begin = at;
            // A short match among many misses is chance: noise goes on behind it.
            misses = if length < 4 * MIN_MATCH { misses - misses / 8 } else { 0 };
        } else {
            at += 1 + (misses >> 5);
            misses += 1;
        }
    }
    steps.push(Step { literals: (data.len() - begin) as u32, length: 0, distance: 0 });
    steps
}

/// The symbol (from 257), number of extra bits and their value of a match length 3 ..= 258.
fn length_symbol(length: u16) -> (usize, u32, u32) {
    if length == 258 {
        return (285, 0, 0);
    }
    let l = u32::from(length) - 3;
    if l < 8 {
        return (257 + l as usize, 0, 0);
    }
    let extra = 29 - l.leading_zeros(); // floor(log2(l)) - 2
    (257 + 4 * (extra as usize + 1) + (l >> extra & 3) as usize, extra, l & ((1 << extra) - 1))
}

/// The symbol, number of extra bits and their value of a distance, given as distance - 1.
fn distance_symbol(d: u16) -> (usize, u32, u32) {
    let d = u32::from(d);
    if d < 4 {
        return (d as usize, 0, 0);
    }
    let extra = 30 - d.leading_zeros(); // floor(log2(d)) - 1
    (2 * (extra as usize + 1) + (d >> extra & 1) as usize, extra, d & ((1 << extra) - 1))
}

/// Code lengths of a Huffman code over `counts`, none longer than `longest`. At least two symbols get a
/// code, so that every decoder accepts the table.
fn lengths<const K: usize>(counts: &[u32; K], longest: usize) -> [u8; K] {
    let mut out = [0u8; K];
    let mut used: Vec<(u32, usize)> = counts.iter().copied().zip(0..).filter(|&(n, _)| n > 0).collect();
    for k in 0.. {
        if used.len() >= 2 {
            break;
        }
        if counts[k] == 0 {
            used.push((1, k));
        }
    }
    used.sort_unstable(); // Pairs differ in their symbol: the order is total.
    // Two queues: leaves in order, and inner nodes, which arise in order.
    let n = used.len();
    let mut weight: Vec<u64> = used.iter().map(|&(w, _)| u64::from(w)).collect();
    let mut parent = vec![0usize; 2 * n - 1];
    let (mut leaf, mut inner) = (0, n);
    for node in n..2 * n - 1 {
        let mut sum = 0;
        for _ in 0..2 {
            let k = if leaf < n && (inner >= node || weight[leaf] <= weight[inner]) { &mut leaf } else { &mut inner };
            sum += weight[*k];
            parent[*k] = node;
            *k += 1;
        }
        weight.push(sum);
    }
    let mut depth = vec![0usize; 2 * n - 1];
    let mut per_length = [0u32; 64];
    for k in (0..2 * n - 2).rev() {
        depth[k] = depth[parent[k]] + 1;
        if k < n {
            per_length[depth[k].min(longest)] += 1;
        }
    }
    // Too long codes were cut: lengthen shorter ones until the code is complete again (Kraft's sum is 1).
    let mut total: u64 = (1..=longest).map(|l| u64::from(per_length[l]) << (longest - l)).sum();
    while total > 1 << longest {
        per_length[longest] -= 1;
        let l = (1..longest).rev().find(|&l| per_length[l] > 0).expect("a code can be lengthened");
        per_length[l] -= 1;
        per_length[l + 1] += 2;
        total -= 1;
    }
    // The rarest symbols get the longest codes.
    let mut symbols = used.iter();
    for l in (1..=longest).rev() {
        for _ in 0..per_length[l] {
            out[symbols.next().expect("as many codes as symbols").1] = l as u8;
        }
    }
    out
}

/// The canonical codes of code lengths, bits reversed as Deflate sends them, length in the upper half.
fn codes<const K: usize>(lengths: &[u8; K]) -> [u32; K] {
    let mut next = [0u32; 16];
    let mut code = 0;
    for l in 1..16 {
        next[l] = code;
        code = (code + lengths.iter().filter(|&&x| usize::from(x) == l).count() as u32) << 1;
    }
    lengths.map(|l| {
        if l == 0 {
            return 0;
        }
        let c = next[usize::from(l)];
        next[usize::from(l)] += 1;
        c.reverse_bits() >> (32 - u32::from(l)) | u32::from(l) << 16
    })
}

struct Bits {
    out: Vec<u8>,
    at: usize,
    buffer: u64,
    count: u32,
}

impl Bits {
    /// Adds at most 48 bits after a flush; the caller flushes in between.
    #[inline(always)]
    fn add(&mut self, bits: u32, count: u32) {
        self.buffer |= u64::from(bits) << self.count;
        self.count += count;
    }
    #[inline(always)]
    fn code(&mut self, code: u32) {
        self.add(code & 0xffff, code >> 16);
    }
    /// Moves whole bytes out; less than 8 bits stay.
    #[inline(always)]
    fn flush(&mut self) {
        self.out[self.at..self.at + 8].copy_from_slice(&self.buffer.to_le_bytes());
        self.at += (self.count / 8) as usize;
        self.buffer >>= self.count & !7;
        self.count &= 7;
    }
}

fn huffman(data: &[u8], steps: &[Step]) -> Vec<u8> {
    // Four histograms, so that equal neighbours do not wait for one another.
    let mut count = [[0u32; 256]; 4];
    let (mut literal, mut distance) = ([0u32; 286], [0u32; 30]);
    let mut at = 0;
    for s in steps {
        let run = &data[at..at + s.literals as usize];
        let four = run.chunks_exact(4);
        four.remainder().iter().for_each(|&b| count[0][usize::from(b)] += 1);
        four.for_each(|b| (0..4).for_each(|k| count[k][usize::from(b[k])] += 1));
        at += run.len() + usize::from(s.length);
        if s.length > 0 {
            literal[length_symbol(s.length).0] += 1;
            distance[distance_symbol(s.distance).0] += 1;
        }
    }
    for (k, l) in literal[..256].iter_mut().enumerate() {
        *l = count.iter().map(|c| c[k]).sum();
    }
    literal[256] = 1;
    let (literal, distance) = (lengths(&literal, LONGEST), lengths(&distance, LONGEST));
    let (literal_code, distance_code) = (codes(&literal), codes(&distance));

    // No symbol takes more than 12 bits per byte that it stands for; header and slack besides.
    let mut bits = Bits { out: vec![0; data.len() + data.len() / 2 + 1024], at: 0, buffer: 0, count: 0 };
    header(&mut bits, &literal, &distance);
    at = 0;
    for s in steps {
        let run = &data[at..at + s.literals as usize];
        let four = run.chunks_exact(4);
        let rest = four.remainder();
        for b in four {
            b.iter().for_each(|&b| bits.code(literal_code[usize::from(b)]));
            bits.flush();
        }
        rest.iter().for_each(|&b| bits.code(literal_code[usize::from(b)]));
        bits.flush();
        at += run.len() + usize::from(s.length);
        if s.length > 0 {
            // At most 12 + 5 + 12 + 13 bits.
            let (symbol, extra, value) = length_symbol(s.length);
            bits.code(literal_code[symbol]);
            bits.add(value, extra);
            let (symbol, extra, value) = distance_symbol(s.distance);
            bits.code(distance_code[symbol]);
            bits.add(value, extra);
            bits.flush();
        }
    }
    bits.code(literal_code[256]);
    // An empty stored block: three bits, then to the next byte, then the length 0 and its complement.
    bits.add(0, 3);
    let pad = (8 - bits.count % 8) % 8;
    bits.add(0, pad);
    bits.flush();
    bits.out.truncate(bits.at);
    bits.out.extend([0, 0, 0xff, 0xff]);
    bits.out
}

/// The header of a dynamic block: the code lengths, run-length coded, in a Huffman code of their own.
fn header(bits: &mut Bits, literal: &[u8; 286], distance: &[u8; 30]) {
    const ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
    let used = |l: &[u8], least: usize| l.iter().rposition(|&x| x > 0).map_or(least, |k| (k + 1).max(least));
    let (literals, distances) = (used(literal, 257), used(distance, 1));
    let all: Vec<u8> = literal[..literals].iter().chain(&distance[..distances]).copied().collect();
    // Symbol, value of the extra bits.
    let mut runs: Vec<(usize, u32)> = Vec::new();
    let mut k = 0;
    while k < all.len() {
        let run = all[k..].iter().take_while(|&&x| x == all[k]).count();
        match (all[k], run) {
            (0, 11..) => {
                let n = run.min(138);
                runs.push((18, n as u32 - 11));
                k += n;
            }
            (0, 3..) => {
                runs.push((17, run as u32 - 3));
                k += run;
            }
            (l, 4..) => {
                let n = (run - 1).min(6);
                runs.extend([(usize::from(l), 0), (16, n as u32 - 3)]);
                k += n + 1;
            }
            (l, _) => {
                runs.push((usize::from(l), 0));
                k += 1;
            }
        }
    }
    let mut count = [0u32; 19];
    runs.iter().for_each(|&(s, _)| count[s] += 1);
    let small = lengths(&count, 7);
    let code = codes(&small);
    let sent = ORDER.iter().rposition(|&s| small[s] > 0).map_or(4, |k| (k + 1).max(4));
    bits.add(0b100, 3); // not final, dynamic
    bits.add(literals as u32 - 257, 5);
    bits.add(distances as u32 - 1, 5);
    bits.add(sent as u32 - 4, 4);
    bits.flush();
    for &s in &ORDER[..sent] {
        bits.add(u32::from(small[s]), 3);
        bits.flush();
    }
    for (s, value) in runs {
        bits.code(code[s]);
        bits.add(value, [2, 3, 7].get(s.wrapping_sub(16)).copied().unwrap_or(0));
        bits.flush();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A reader that is not ours.
    fn unpack(deflated: &[u8]) -> Vec<u8> {
        let mut all = vec![0x78, 1];
        all.extend(deflated);
        all.extend([3, 0, 0, 0, 0, 0]); // the final, empty block, and a sum that is not looked at
        let mut out = vec![0; 4 << 20];
        let mut inflate = fdeflate::Decompressor::new();
        inflate.ignore_adler32();
        let mut have = 0;
        let mut read = 0;
        while !inflate.is_done() {
            let (r, w) = inflate.read(&all[read..], &mut out, have, true).unwrap_or_else(|e| panic!("{e:?}"));
            (read, have) = (read + r, have + w);
            if r == 0 && w == 0 {
                break;
            }
        }
        out.truncate(have);
        out
    }

    fn noise(n: usize, mut seed: u32, shift: u32) -> Vec<u8> {
        std::iter::repeat_with(|| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> shift) as u8
        })
        .take(n)
        .collect()
    }

    #[test]
    fn every_kind_of_data_comes_back() {
        let mut text = Vec::new();
        for k in noise(9000, 3, 29) {
            text.extend(&b"a carved stone relief, lit from the side"[..4 * usize::from(k) + 5]);
        }
        // One symbol so common that an unlimited code would be longer than 12 bits for the rare ones.
        let mut skewed = vec![];
        for k in 0..24u8 {
            skewed.extend(std::iter::repeat_n([k, k.wrapping_mul(91)], 1 << (k / 2)).flatten());
        }
        let all = [
            vec![],
            vec![7],
            b"abc".to_vec(),
            vec![0; 100_000],
            noise(100_000, 1, 24),
            noise(100_000, 1, 27),
            (0..200_000u32).map(|k| (k / 300) as u8).collect(),
            text,
            skewed,
        ];
        for data in all {
            assert!(unpack(&blocks(&data)) == data, "{} bytes", data.len());
        }
    }

    #[test]
    fn it_compresses() {
        assert!(blocks(&vec![9; 100_000]).len() < 600); // 388 matches of 258, some 8 bits each
        let n = noise(100_000, 1, 24);
        assert!(blocks(&n).len() <= n.len() + 10); // stored
        // Four bits of entropy per byte.
        assert!(blocks(&noise(100_000, 1, 28)).len() < 52_000);
    }

    #[test]
    fn a_code_is_complete_and_within_its_limit() {
        let mut counts = [0u32; 286];
        let (mut a, mut b) = (1u32, 1u32);
        for c in &mut counts[..40] {
            (*c, a, b) = (a, b, a.saturating_add(b)); // Fibonacci: the deepest tree there is
        }
        let l = lengths(&counts, 12);
        let kraft: u32 = l.iter().filter(|&&l| l > 0).map(|&l| 1 << (12 - l)).sum();
        assert_eq!((kraft, l.iter().filter(|&&l| l > 0).count()), (1 << 12, 40));
        assert!(l.iter().all(|&l| l <= 12));
    }

    #[test]
    fn every_length_and_distance_has_its_symbol() {
        // RFC 1951, 3.2.5, at the edges.
        for (l, want) in [
            (3, (257, 0, 0)),
            (10, (264, 0, 0)),
            (11, (265, 1, 0)),
            (18, (268, 1, 1)),
            (19, (269, 2, 0)),
            (257, (284, 5, 30)),
            (258, (285, 0, 0)),
        ] {
            assert_eq!(length_symbol(l), want, "{l}");
        }
        for (d, want) in [
            (1u32, (0, 0, 0)),
            (4, (3, 0, 0)),
            (5, (4, 1, 0)),
            (8, (5, 1, 1)),
            (9, (6, 2, 0)),
            (24577, (29, 13, 0)),
            (32768, (29, 13, 8191)),
        ] {
            assert_eq!(distance_symbol((d - 1) as u16), want, "{d}");
        }
    }
}
