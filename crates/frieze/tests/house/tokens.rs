//! As much of Rust's grammar as the laws need: words and marks without comments and strings, paths, test items.

/// A word, or one character of punctuation.
#[derive(Clone, Debug, PartialEq)]
pub enum Token {
    /// Keywords, names and numbers.
    Ident(String),
    /// `::` is two of them.
    Mark(char),
}

impl Token {
    fn is(&self, mark: char) -> bool {
        *self == Token::Mark(mark)
    }
    fn ident(&self) -> Option<&str> {
        match self {
            Token::Ident(word) => Some(word),
            Token::Mark(_) => None,
        }
    }
}

/// The tokens of a source text. Literals of strings and characters, lifetimes and comments are left out.
pub fn tokens(text: &str) -> Vec<Token> {
    let c: Vec<char> = text.chars().collect();
    let at = |k: usize| c.get(k).copied().unwrap_or('\0');
    let mut all = Vec::new();
    let mut k = 0;
    while k < c.len() {
        if at(k) == '/' && at(k + 1) == '/' {
            while k < c.len() && at(k) != '\n' {
                k += 1;
            }
        } else if at(k) == '/' && at(k + 1) == '*' {
            let mut depth = 0;
            loop {
                match (at(k), at(k + 1)) {
                    ('/', '*') => (depth, k) = (depth + 1, k + 2),
                    ('*', '/') => (depth, k) = (depth - 1, k + 2),
                    _ => k += 1,
                }
                if depth == 0 || k >= c.len() {
                    break;
                }
            }
        } else if at(k) == '"' {
            k += 1;
            while k < c.len() && at(k) != '"' {
                k += if at(k) == '\\' { 2 } else { 1 };
            }
            k += 1;
        } else if at(k) == '\'' {
            // A character, or a lifetime: one letter without a closing quote.
            if at(k + 1) == '\\' {
                k += 3;
                while k < c.len() && at(k) != '\'' {
                    k += 1;
                }
                k += 1;
            } else if at(k + 2) == '\'' {
                k += 3;
            } else {
                k += 1;
                while at(k).is_alphanumeric() || at(k) == '_' {
                    k += 1;
                }
            }
        } else if at(k).is_alphanumeric() || at(k) == '_' {
            let start = k;
            while at(k).is_alphanumeric() || at(k) == '_' {
                k += 1;
            }
            let word: String = c[start..k].iter().collect();
            // Raw and byte strings: the prefix is no name.
            if ["r", "br", "cr"].contains(&&*word) && (at(k) == '"' || at(k) == '#' && ['"', '#'].contains(&at(k + 1)))
            {
                let mut hashes = 0;
                while at(k) == '#' {
                    (hashes, k) = (hashes + 1, k + 1);
                }
                k += 1;
                while k < c.len() && !(at(k) == '"' && (1..=hashes).all(|h| at(k + h) == '#')) {
                    k += 1;
                }
                k += 1 + hashes;
            } else if !(["b", "c"].contains(&&*word) && ['"', '\''].contains(&at(k))) {
                all.push(Token::Ident(word));
            }
        } else {
            if !at(k).is_whitespace() {
                all.push(Token::Mark(at(k)));
            }
            k += 1;
        }
    }
    all
}

/// A source file of the library.
pub struct Module {
    /// Its path from the crate's root; empty for `lib.rs`.
    pub place: Vec<String>,
    /// Places of files that are only compiled for tests, as this file declares them.
    pub test_files: std::collections::BTreeSet<Vec<String>>,
    tokens: Vec<Token>,
}

impl Module {
    /// Takes items under `#[cfg(test)]` out.
    pub fn new(place: Vec<String>, all: Vec<Token>) -> Module {
        let test: Vec<Token> = tokens("#[cfg(test)]");
        let mut module = Module { place, test_files: Default::default(), tokens: Vec::new() };
        let mut k = 0;
        while k < all.len() {
            if !all[k..].starts_with(&test) {
                module.tokens.push(all[k].clone());
                k += 1;
                continue;
            }
            k += test.len();
            let start = k;
            // The item ends with the `}` of its first `{`, or with a `;` outside of brackets.
            let mut depth = 0;
            while k < all.len() {
                match all[k] {
                    Token::Mark('{' | '(' | '[') => depth += 1,
                    Token::Mark('}' | ')' | ']') => depth -= 1,
                    _ => {}
                }
                k += 1;
                if depth == 0 && (all[k - 1].is(';') || all[k - 1].is('}')) {
                    break;
                }
            }
            if let [Token::Ident(m), Token::Ident(name), Token::Mark(';')] = &all[start..k]
                && m == "mod"
            {
                module.test_files.insert(module.place.iter().chain([name]).cloned().collect());
            }
        }
        module
    }

    /// For messages.
    pub fn name(&self) -> String {
        if self.place.is_empty() { "lib.rs".into() } else { format!("{}.rs", self.place.join("/")) }
    }

    /// All words.
    pub fn idents(&self) -> impl Iterator<Item = &str> {
        self.tokens.iter().filter_map(Token::ident)
    }

    /// The first path with `before::wanted` in it, also as `before::{.., wanted, ..}`: its last word.
    pub fn path_ends(&self, before: &[&str], wanted: &[&str]) -> Option<String> {
        (0..self.tokens.len()).find_map(|k| {
            self.tokens[k].ident().filter(|i| before.contains(i))?;
            let mut paths = Vec::new();
            self.tree(k, Vec::new(), &mut paths);
            paths.into_iter().find_map(|p| p.get(1).filter(|w| wanted.contains(&w.as_str())).cloned())
        })
    }

    /// Every path that begins with `crate` or `super`, resolved, from the crate's root. A path out of this file into
    /// this file's own room begins with that room.
    pub fn paths(&self) -> Vec<Vec<String>> {
        let mut all = Vec::new();
        let mut inner: Vec<(String, usize)> = Vec::new();
        let mut depth = 0;
        for (k, token) in self.tokens.iter().enumerate() {
            if token.is('{') {
                depth += 1;
                if let Some([Token::Ident(m), Token::Ident(name)]) = k.checked_sub(2).map(|s| &self.tokens[s..k])
                    && m == "mod"
                {
                    inner.push((name.clone(), depth));
                }
            } else if token.is('}') {
                inner.pop_if(|(_, d)| *d == depth);
                depth -= 1;
            }
            let inside = k >= 2 && self.tokens[k - 1].is(':') && self.tokens[k - 2].is(':');
            if inside || !matches!(token.ident(), Some("crate" | "super")) || !self.leads_on(k + 1) {
                continue;
            }
            let mut paths = Vec::new();
            self.tree(k, Vec::new(), &mut paths);
            for path in paths {
                let here = self.place.iter().chain(inner.iter().map(|(name, _)| name));
                let mut resolved: Vec<String> = here.cloned().collect();
                for word in path {
                    match word.as_str() {
                        "crate" => resolved.clear(),
                        "super" => drop(resolved.pop()),
                        _ => resolved.push(word),
                    }
                }
                all.push(resolved);
            }
        }
        all.retain(|p| !p.is_empty());
        all
    }

    fn leads_on(&self, k: usize) -> bool {
        self.tokens.get(k..k + 2).is_some_and(|t| t[0].is(':') && t[1].is(':'))
    }

    /// Reads the path or use tree at token `k`; returns where it ends.
    fn tree(&self, mut k: usize, mut path: Vec<String>, all: &mut Vec<Vec<String>>) -> usize {
        loop {
            match self.tokens.get(k) {
                Some(Token::Ident(word)) => {
                    if word != "self" {
                        path.push(word.clone());
                    }
                    k += 1;
                    if !self.leads_on(k) {
                        break;
                    }
                    k += 2;
                }
                Some(Token::Mark('{')) => {
                    k += 1;
                    while k < self.tokens.len() && !self.tokens[k].is('}') {
                        k = self.tree(k, path.clone(), all);
                        // `as name`, and the comma.
                        while k < self.tokens.len() && !self.tokens[k].is(',') && !self.tokens[k].is('}') {
                            k += 1;
                        }
                        k += usize::from(self.tokens.get(k).is_some_and(|t| t.is(',')));
                    }
                    return k + 1;
                }
                _ => break,
            }
        }
        all.push(path);
        k
    }
}
