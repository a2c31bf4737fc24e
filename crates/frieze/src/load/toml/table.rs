//! Checked access to the tables of a scene file: every key that is asked for becomes a known key, every other is
//! an error that names the nearest one; every wrong value names its line.

use crate::error::{Error, Finding, Result};
use ::toml::Spanned;
use ::toml::de::{DeTable, DeValue};
use std::cell::RefCell;
use std::ops::Range;
use std::path::Path;

/// The file, and what was found in it.
pub(super) struct Source<'a> {
    pub text: &'a str,
    pub path: &'a Path,
    pub findings: RefCell<Vec<Finding>>,
}

impl Source<'_> {
    /// `line 7`
    pub fn line(&self, at: usize) -> String {
        let before = self.text.as_bytes().get(..at.min(self.text.len())).unwrap_or_default();
        format!("line {}", before.iter().filter(|&&b| b == b'\n').count() + 1)
    }
    pub fn error(&self, code: &'static str, at: usize, message: impl Into<String>) -> Error {
        Error::input(code, message).in_file(self.path).at(self.line(at))
    }
}

/// A table, by the name that it has in the file.
pub(super) struct Table<'a> {
    pub source: &'a Source<'a>,
    pub name: String,
    pub at: usize,
    entries: Vec<(&'a str, Range<usize>, &'a Spanned<DeValue<'a>>)>,
    asked: RefCell<Vec<&'static str>>,
}

impl<'a> Table<'a> {
    pub fn new(source: &'a Source<'a>, name: String, at: usize, table: &'a DeTable<'a>) -> Self {
        let mut entries: Vec<_> = table.iter().map(|(k, v)| (k.get_ref().as_ref(), k.span(), v)).collect();
        entries.sort_by_key(|e| e.1.start); // in the order of the file
        Table { source, name, at, entries, asked: RefCell::default() }
    }
    /// The name of a key, with that of the table.
    fn full(&self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) }
    }
    /// The value of a key; from now on the key is known.
    pub fn get(&self, key: &'static str) -> Option<Value<'a>> {
        self.asked.borrow_mut().push(key);
        let (_, at, value) = self.entries.iter().find(|e| e.0 == key)?;
        Some(Value { source: self.source, name: self.full(key), at: at.start, value: value.get_ref() })
    }
    /// All values, for a table whose keys are names.
    pub fn all(&self) -> Vec<(&'a str, Value<'a>)> {
        let each = self.entries.iter();
        each.map(|(k, at, v)| (*k, Value { source: self.source, name: self.full(k), at: at.start, value: v.get_ref() }))
            .collect()
    }
    /// The value of a key that must be there.
    pub fn need(&self, key: &'static str) -> Result<Value<'a>> {
        self.get(key).ok_or_else(|| {
            let inside = if self.name.is_empty() { "the file".into() } else { format!("[{}]", self.name) };
            self.source.error("scene.missing-key", self.at, format!("{inside} needs the key `{key}`"))
        })
    }
    /// Refuses keys that were never asked for.
    ///
    /// # Errors
    /// `scene.unknown-key`
    pub fn finish(&self) -> Result<()> {
        let known = self.asked.borrow();
        match self.entries.iter().find(|e| !known.contains(&e.0)) {
            None => Ok(()),
            Some((key, at, _)) => {
                let shown: String = key.chars().take(60).collect();
                let mut error =
                    self.source.error("scene.unknown-key", at.start, format!("unknown key `{}`", self.full(&shown)));
                error = error.remedy(match synonym(key, &known).or_else(|| nearest(key, known.iter().copied())) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => {
                        let mut all: Vec<&str> = Vec::new();
                        known.iter().for_each(|k| {
                            if !all.contains(k) {
                                all.push(k)
                            }
                        });
                        format!("possible keys are {}", all.join(", "))
                    }
                });
                Err(error)
            }
        }
    }

    // Shorthands: the value of a key, or `None` where it is not given.

    pub fn f32(&self, key: &'static str) -> Result<Option<f32>> {
        self.get(key).map(|v| v.f32()).transpose()
    }
    pub fn within(&self, key: &'static str, range: std::ops::RangeInclusive<f32>) -> Result<Option<f32>> {
        self.get(key).map(|v| v.within(range)).transpose()
    }
    pub fn above_zero(&self, key: &'static str) -> Result<Option<f32>> {
        self.within(key, f32::MIN_POSITIVE..=f32::MAX)
    }
    pub fn u32(&self, key: &'static str, range: std::ops::RangeInclusive<u32>) -> Result<Option<u32>> {
        self.get(key).map(|v| v.u32(range)).transpose()
    }
    pub fn bool(&self, key: &'static str) -> Result<Option<bool>> {
        self.get(key).map(|v| v.bool()).transpose()
    }
    pub fn str(&self, key: &'static str) -> Result<Option<&'a str>> {
        self.get(key).map(|v| v.str()).transpose()
    }
    pub fn floats<const K: usize>(&self, key: &'static str) -> Result<Option<[f32; K]>> {
        self.get(key).map(|v| v.floats()).transpose()
    }
    /// Colour: three numbers that are not negative.
    pub fn color(&self, key: &'static str) -> Result<Option<[f32; 3]>> {
        self.get(key).map(|v| v.color()).transpose()
    }
    pub fn word<T: Copy>(&self, key: &'static str, words: &[(&str, T)]) -> Result<Option<T>> {
        self.get(key).map(|v| v.word(words)).transpose()
    }
    pub fn table(&self, key: &'static str) -> Result<Option<Table<'a>>> {
        self.get(key).map(|v| v.table()).transpose()
    }
    /// A table, or a list of tables.
    pub fn tables(&self, key: &'static str) -> Result<Vec<Table<'a>>> {
        match self.get(key) {
            None => Ok(Vec::new()),
            Some(v) if matches!(v.value, DeValue::Array(_)) => v.list()?.iter().map(Value::table).collect(),
            Some(v) => Ok(vec![v.table()?]),
        }
    }
}

/// A value, by the name of its key.
#[derive(Clone)]
pub(super) struct Value<'a> {
    pub source: &'a Source<'a>,
    pub name: String,
    pub at: usize,
    value: &'a DeValue<'a>,
}

impl<'a> Value<'a> {
    /// `scene.type`: it should be something else.
    fn not(&self, what: &str) -> Error {
        let is = match self.value {
            DeValue::String(_) => "a text",
            DeValue::Integer(_) | DeValue::Float(_) => "a number",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date",
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        self.source.error("scene.type", self.at, format!("`{}` is {is}, not {what}", self.name))
    }
    /// `scene.range`: it is possible in kind, but not in value.
    pub fn out_of_range(&self, what: impl std::fmt::Display) -> Error {
        self.source.error("scene.range", self.at, format!("`{}` {what}", self.name))
    }
    /// Tells that what the contract does by default, and the file did not ask for, is not done by this version.
    pub fn default_not_yet(&self, message: String, action: &str) {
        if self.source.findings.borrow().len() < 1000 {
            let finding = Finding::note("scene.not-yet", message, action.to_owned());
            self.source.findings.borrow_mut().push(finding.in_file(self.source.path).at(self.source.line(self.at)));
        }
    }
    /// Tells that this is understood, but not done by this version.
    pub fn not_yet(&self, action: &str) {
        // Each is told with its line, which is counted from the file's beginning: nobody reads a million of them.
        if self.source.findings.borrow().len() >= 1000 {
            return;
        }
        let finding = Finding::warning(
            "scene.not-yet",
            format!("`{}` is not rendered by this version", self.name),
            action.to_owned(),
        );
        self.source.findings.borrow_mut().push(finding.in_file(self.source.path).at(self.source.line(self.at)));
    }
    pub fn is_str(&self) -> bool {
        self.value.is_str()
    }
    pub fn is_bool(&self) -> bool {
        self.value.is_bool()
    }
    pub fn is_table(&self) -> bool {
        self.value.is_table()
    }
    pub fn is_list(&self) -> bool {
        self.value.is_array()
    }
    fn f64(&self) -> Result<f64> {
        match self.value {
            DeValue::Float(f) => f.as_str().replace('_', "").parse().map_err(|_| self.not("a number")),
            DeValue::Integer(_) => self.integer().map(|i| i as f64),
            _ => Err(self.not("a number")),
        }
    }
    fn integer(&self) -> Result<i64> {
        match self.value {
            DeValue::Integer(i) => i64::from_str_radix(&i.as_str().replace('_', ""), i.radix())
                .map_err(|_| self.out_of_range("does not fit 64 bits")),
            _ => Err(self.not("a whole number")),
        }
    }
    /// A number, finite as f32.
    pub fn f32(&self) -> Result<f32> {
        let v = self.f64()? as f32;
        if v.is_finite() { Ok(v) } else { Err(self.out_of_range("must be finite")) }
    }
    pub fn within(&self, range: std::ops::RangeInclusive<f32>) -> Result<f32> {
        let v = self.f32()?;
        if range.contains(&v) {
            return Ok(v);
        }
        Err(self.out_of_range(match (*range.start(), *range.end()) {
            (a, b) if a == f32::MIN_POSITIVE && b == f32::MAX => format!("is {v}; it must be above 0"),
            (a, b) if b == f32::MAX => format!("is {v}; it must be at least {a}"),
            (a, b) => format!("is {v}; it must be from {a} to {b}"),
        }))
    }
    /// A number above 0, or infinity.
    pub fn above_zero_or_infinite(&self) -> Result<f32> {
        let v = self.f64()? as f32;
        if v > 0.0 { Ok(v) } else { Err(self.out_of_range(format_args!("is {v}; it must be above 0"))) }
    }
    pub fn u32(&self, range: std::ops::RangeInclusive<u32>) -> Result<u32> {
        let v = self.integer()?;
        u32::try_from(v).ok().filter(|v| range.contains(v)).ok_or_else(|| {
            self.out_of_range(format_args!("is {v}; it must be from {} to {}", range.start(), range.end()))
        })
    }
    pub fn bool(&self) -> Result<bool> {
        self.value.as_bool().ok_or_else(|| self.not("true or false"))
    }
    pub fn str(&self) -> Result<&'a str> {
        self.value.as_str().ok_or_else(|| self.not("a text"))
    }
    pub fn word<T: Copy>(&self, words: &[(&str, T)]) -> Result<T> {
        let word = self.str()?;
        words.iter().find(|w| w.0 == word).map(|w| w.1).ok_or_else(|| {
            let shown: String = word.chars().take(60).collect();
            let all: Vec<_> = words.iter().map(|w| w.0).collect();
            let error = self.out_of_range(format_args!("is \"{shown}\"; possible are {}", all.join(", ")));
            match nearest(word, all.into_iter()) {
                Some(near) => error.remedy(format!("did you mean \"{near}\"?")),
                None => error,
            }
        })
    }
    pub fn list(&self) -> Result<Vec<Value<'a>>> {
        let list = self.value.as_array().ok_or_else(|| self.not("a list"))?;
        let each = list.iter().enumerate();
        Ok(each
            .map(|(k, v)| Value {
                source: self.source,
                name: format!("{}[{k}]", self.name),
                at: v.span().start,
                value: v.get_ref(),
            })
            .collect())
    }
    pub fn floats<const K: usize>(&self) -> Result<[f32; K]> {
        let list = self.list().map_err(|_| self.not(&format!("a list of {K} numbers")))?;
        let found = list.len();
        let list: [Value; K] =
            list.try_into().map_err(|_| self.out_of_range(format_args!("has {found} entries; it must have {K}")))?;
        let mut out = [0.0; K];
        for (o, v) in out.iter_mut().zip(&list) {
            *o = v.f32()?;
        }
        Ok(out)
    }
    pub fn color(&self) -> Result<[f32; 3]> {
        let c: [f32; 3] = self.floats()?;
        if c.iter().all(|&v| v >= 0.0) { Ok(c) } else { Err(self.out_of_range("must not be negative")) }
    }
    pub fn table(&self) -> Result<Table<'a>> {
        match self.value {
            DeValue::Table(t) => Ok(Table::new(self.source, self.name.clone(), self.at, t)),
            _ => Err(self.not("a table")),
        }
    }
}

/// The candidate with the smallest edit distance, the first of equals; `None` when it is not near: at most two
/// letters or a third of them apart, and less than half.
pub(super) fn nearest<'k>(word: &str, candidates: impl Iterator<Item = &'k str>) -> Option<&'k str> {
    let (apart, near) = candidates.map(|c| (distance(word, c), c)).min_by_key(|c| c.0)?;
    let letters = word.chars().count().max(near.len()).min(64);
    (apart <= (letters / 3).max(2) && 2 * apart <= letters).then_some(near)
}

/// What other programs call a key that is known here.
fn synonym(word: &str, known: &[&'static str]) -> Option<&'static str> {
    const OTHERS: [(&str, &[&str]); 20] = [
        ("position", &["translate", "eye"]),
        ("translation", &["translate"]),
        ("location", &["translate", "position"]),
        ("from", &["eye"]),
        ("rotation", &["rotate"]),
        ("look_at", &["target"]),
        ("to", &["target"]),
        ("fov", &["fov_y"]),
        ("type", &["kind", "primitive", "model"]),
        ("file", &["mesh"]),
        ("model", &["mesh"]),
        ("resolution", &["size"]),
        ("width", &["size"]),
        ("msaa", &["samples"]),
        ("color", &["base_color"]),
        ("texture", &["base_color_map"]),
        ("metalness", &["metallic"]),
        ("emission", &["emissive"]),
        ("transparency", &["opacity"]),
        ("strength", &["intensity", "scale"]),
    ];
    let (_, names) = OTHERS.iter().find(|o| o.0 == word)?;
    names.iter().find_map(|n| known.iter().find(|k| *k == n).copied())
}

/// Levenshtein's distance, of at most the first 64 letters.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(64).enumerate() {
        let mut corner = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let change = corner + usize::from(x != *y);
            corner = row[j + 1];
            row[j + 1] = change.min(row[j] + 1).min(corner + 1);
        }
    }
    row[b.len()]
}
