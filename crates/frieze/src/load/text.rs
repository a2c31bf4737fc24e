//! Numbers and words of text formats, read without a copy and with the same bits on every machine.

/// A place in a text of lines. Blanks are spaces and tabs, and a backslash at the end of a line.
#[derive(Clone, Copy, Debug)]
pub struct Cursor<'a> {
    bytes: &'a [u8],
    /// The next byte.
    pub at: usize,
}

impl<'a> Cursor<'a> {
    /// The beginning of a text.
    pub fn new(bytes: &'a [u8]) -> Self {
        Cursor { bytes, at: 0 }
    }
    /// Whether nothing is left.
    pub fn is_done(&self) -> bool {
        self.at >= self.bytes.len()
    }
    /// The next byte; a line end at the end of the text.
    #[inline(always)]
    pub fn peek(&self) -> u8 {
        self.bytes.get(self.at).copied().unwrap_or(b'\n')
    }
    /// Passes blanks.
    #[inline(always)]
    pub fn skip_blanks(&mut self) {
        loop {
            match self.peek() {
                b' ' | b'\t' => self.at += 1,
                b'\\' => match self.bytes.get(self.at + 1..) {
                    Some([b'\n', ..]) => self.at += 2,
                    Some([b'\r', b'\n', ..]) => self.at += 3,
                    _ => return,
                },
                _ => return,
            }
        }
    }
    /// Passes blanks; whether the line, or what is not a comment of it, ends there.
    #[inline(always)]
    pub fn is_line_end(&mut self) -> bool {
        self.skip_blanks();
        matches!(self.peek(), b'\n' | b'\r' | b'#')
    }
    /// Goes to the beginning of the next line.
    #[inline(always)]
    pub fn next_line(&mut self) {
        let rest = &self.bytes[self.at.min(self.bytes.len())..];
        self.at += rest.iter().position(|&b| b == b'\n').map_or(rest.len(), |k| k + 1);
    }
    /// Passes blanks, and the word after them.
    #[inline(always)]
    pub fn word(&mut self) -> &'a [u8] {
        self.skip_blanks();
        let begin = self.at.min(self.bytes.len());
        while !matches!(self.peek(), b' ' | b'\t' | b'\n' | b'\r') {
            self.at += 1;
        }
        &self.bytes[begin..self.at]
    }
    /// The rest of the line, without blanks around it; the next line comes next.
    pub fn rest(&mut self) -> &'a [u8] {
        self.skip_blanks();
        let begin = self.at.min(self.bytes.len());
        self.next_line();
        self.bytes[begin..self.at].trim_ascii()
    }
    /// Passes spaces, tabs and line ends, for formats whose lines mean nothing.
    #[inline(always)]
    pub fn skip_space(&mut self) {
        while self.at < self.bytes.len() && self.bytes[self.at].is_ascii_whitespace() {
            self.at += 1;
        }
    }
    /// A whole number, with a sign; `None` where there is none (and nothing is passed) or it is too large.
    #[inline(always)]
    pub fn integer(&mut self) -> Option<i64> {
        let begin = self.at;
        let negative = self.peek() == b'-';
        self.at += usize::from(negative || self.peek() == b'+');
        let (mut value, digits) = (0i64, self.at);
        while self.peek().is_ascii_digit() {
            // 18 digits cannot overflow; more are no index of anything.
            value = value.wrapping_mul(10).wrapping_add(i64::from(self.peek() - b'0'));
            self.at += 1;
        }
        if self.at == digits || self.at - digits > 18 {
            self.at = begin;
            return None;
        }
        Some(if negative { -value } else { value })
    }
    /// A number, after blanks. `None` where there is none (and nothing is passed).
    #[inline(always)]
    pub fn float(&mut self) -> Option<f32> {
        self.skip_blanks();
        let mut ahead = *self;
        let word = ahead.word();
        let value = float(word)?;
        *self = ahead;
        Some(value)
    }
}

/// 10^0 ..= 10^22: exact in f64.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// The f32 nearest to a decimal number; also `nan` and `inf`. `None` when the word is no number.
///
/// Up to 15 digits with a power of ten up to 22 take one exact f64 operation (Clinger 1990, "How to Read
/// Floating Point Numbers Accurately"). Rounding its result to f32 is right too unless the f64 lies exactly
/// between two f32; that, and everything longer, goes to the standard library.
#[inline(always)]
pub fn float(word: &[u8]) -> Option<f32> {
    fast_float(word).or_else(|| std::str::from_utf8(word).ok()?.parse().ok())
}

#[inline(always)]
fn fast_float(word: &[u8]) -> Option<f32> {
    let mut k = 0;
    let negative = word.first() == Some(&b'-');
    k += usize::from(negative || word.first() == Some(&b'+'));
    let (mut mantissa, mut digits, mut scale) = (0u64, 0, 0i32);
    while let Some(d) = word.get(k).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
        mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(d));
        digits += 1;
        k += 1;
    }
    if word.get(k) == Some(&b'.') {
        k += 1;
        while let Some(d) = word.get(k).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(d));
            digits += 1;
            scale -= 1;
            k += 1;
        }
    }
    if digits == 0 || digits > 15 {
        return None;
    }
    if matches!(word.get(k), Some(b'e' | b'E')) {
        k += 1;
        let minus = word.get(k) == Some(&b'-');
        k += usize::from(minus || word.get(k) == Some(&b'+'));
        let first = k;
        let mut exponent = 0i32;
        while let Some(d) = word.get(k).map(|b| b.wrapping_sub(b'0')).filter(|&d| d < 10) {
            exponent = (exponent * 10 + i32::from(d)).min(10_000);
            k += 1;
        }
        if k == first {
            return None;
        }
        scale += if minus { -exponent } else { exponent };
    }
    if k != word.len() || !(-22..=22).contains(&scale) {
        return None;
    }
    let m = mantissa as f64;
    let value = if scale < 0 { m / POWERS[-scale as usize] } else { m * POWERS[scale as usize] };
    let between = value.to_bits() & 0x1fff_ffff == 0x1000_0000;
    if between || (value != 0.0 && value < 1e-30) {
        return None;
    }
    Some(if negative { -value as f32 } else { value as f32 })
}

/// A word as text; what is no UTF-8 is replaced.
pub fn text(word: &[u8]) -> String {
    String::from_utf8_lossy(word).into_owned()
}

/// The number of the line that holds byte `at`, counted from 1.
pub fn line_of(bytes: &[u8], at: usize) -> usize {
    bytes[..at.min(bytes.len())].iter().filter(|&&b| b == b'\n').count() + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_as_the_standard_library_does() {
        let mut state = 7u64;
        let mut random = move || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            state >> 33
        };
        for k in 0..200_000 {
            let word = match k % 5 {
                0 => format!("{}.{:06}", random() as i64 % 1000 - 500, random() % 1_000_000),
                1 => format!("{:e}", f32::from_bits(random() as u32)),
                2 => format!("-{}.{}e{}", random() % 10, random(), random() as i64 % 50 - 25),
                // 15 digits near the middle of two f32, where rounding twice goes wrong.
                3 => {
                    let low = f32::from_bits(0x3f00_0000 + random() as u32 % 0x0200_0000);
                    let high = f32::from_bits(low.to_bits() + 1);
                    format!("{:.14e}", (f64::from(low) + f64::from(high)) / 2.0)
                }
                // Numbers exactly between two f32, and their neighbours in the last digit.
                _ => format!("{}", 16_777_216.0 * 2.0 + (random() % 1000) as f64 * 2.0 + random() as f64 % 3.0 - 1.0),
            };
            let want: f32 = word.parse().unwrap();
            assert_eq!(float(word.as_bytes()).map(f32::to_bits), Some(want.to_bits()), "{word}");
        }
        for word in ["0", "-0", "+1", "1.", ".5", "1e5", "1E-5", "16777217", "33554435", "1e-40", "1e39", "inf", "-inf"]
        {
            assert_eq!(float(word.as_bytes()), word.parse().ok(), "{word}");
        }
        assert!(float(b"nan").unwrap().is_nan());
        for word in ["", ".", "-", "1,5", "e5", "1e", "0x10", "1.2.3", "--1"] {
            assert_eq!(float(word.as_bytes()), None, "{word}");
        }
    }

    #[test]
    fn lines_words_and_continuations() {
        let mut c = Cursor::new(b"f 1 \\\r\n -22 \t3 # end\nname  of it \r\nlast");
        assert_eq!(c.word(), b"f");
        c.skip_blanks();
        assert_eq!(c.integer(), Some(1));
        c.skip_blanks();
        assert_eq!(c.integer(), Some(-22));
        c.skip_blanks();
        assert_eq!((c.integer(), c.is_line_end()), (Some(3), true));
        c.next_line();
        assert_eq!(c.word(), b"name");
        assert_eq!(c.rest(), b"of it");
        assert_eq!(c.rest(), b"last");
        assert!(c.is_done());
        assert_eq!((c.word(), c.rest(), c.integer(), c.float()), (&b""[..], &b""[..], None, None));
        assert_eq!(Cursor::new(b"9999999999999999999").integer(), None);
        assert_eq!(line_of(b"a\nb\nc", 4), 3);
    }
}
