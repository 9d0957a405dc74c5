//! Rust source, read roughly: tokens without comments, texts and test-only items; the paths they spell.

/// A word or a sign of the source.
#[derive(Clone, Debug, PartialEq)]
pub struct Token {
    /// From 1.
    pub line: usize,
    pub text: String,
}

/// A path as the source spells it: `use a::{b, c}` gives `a::b` and `a::c`.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    pub line: usize,
    pub segments: Vec<String>,
    /// Began with `::`, so that it names a crate whatever the file calls so itself.
    pub absolute: bool,
    /// Part of a `use` declaration.
    pub imported: bool,
    /// Names of the inline modules around it.
    pub inside: Vec<String>,
}

/// A file without what only tests see.
pub struct Source {
    pub tokens: Vec<Token>,
    /// Modules in files of their own that only tests see.
    pub test_modules: Vec<String>,
}

/// Reads a file.
pub fn read(text: &str) -> Source {
    without_tests(&tokens(text))
}

fn tokens(text: &str) -> Vec<Token> {
    let chars: Vec<char> = text.chars().collect();
    let (mut i, mut line, mut out) = (0, 1, Vec::new());
    let at = |i: usize| chars.get(i).copied().unwrap_or('\0');
    while i < chars.len() {
        let start = i;
        let word = |c: char| c.is_alphanumeric() || c == '_';
        match at(i) {
            '/' if at(i + 1) == '/' => {
                while i < chars.len() && at(i) != '\n' {
                    i += 1;
                }
            }
            '/' if at(i + 1) == '*' => {
                let mut depth = 0;
                while i < chars.len() {
                    match (at(i), at(i + 1)) {
                        ('/', '*') => (depth, i) = (depth + 1, i + 2),
                        ('*', '/') => (depth, i) = (depth - 1, i + 2),
                        _ => i += 1,
                    }
                    if depth == 0 {
                        break;
                    }
                }
            }
            '"' => i = after_text(&chars, i),
            '\'' if at(i + 1) == '\\' || at(i + 2) == '\'' => {
                i += if at(i + 1) == '\\' { 3 } else { 2 };
                while i < chars.len() && at(i) != '\'' {
                    i += 1;
                }
                i += 1;
            }
            '\'' => {
                i += 1;
                while word(at(i)) {
                    i += 1;
                }
            }
            c if word(c) => {
                while word(at(i)) {
                    i += 1;
                }
                let text: String = chars[start..i].iter().collect();
                match (text.as_str(), at(i)) {
                    ("b" | "c", '"') => i = after_text(&chars, i),
                    ("r" | "br" | "cr", '"' | '#') if raw_hashes(&chars, i).is_some() => {
                        i = after_raw_text(&chars, i);
                    }
                    // `r#type`: the name follows as a token of its own.
                    ("r", '#') => i += 1,
                    _ => out.push(Token { line, text }),
                }
            }
            ':' if at(i + 1) == ':' => {
                out.push(Token { line, text: "::".to_owned() });
                i += 2;
            }
            c => {
                if !c.is_whitespace() {
                    out.push(Token { line, text: c.to_string() });
                }
                i += 1;
            }
        }
        line += chars[start..i.min(chars.len())].iter().filter(|c| **c == '\n').count();
    }
    out
}

/// Index after the text that begins with the quote at `i`.
fn after_text(chars: &[char], mut i: usize) -> usize {
    i += 1;
    while i < chars.len() && chars[i] != '"' {
        i += if chars[i] == '\\' { 2 } else { 1 };
    }
    i + 1
}

/// Number of `#` before the quote of a raw text; `None` when there is no quote.
fn raw_hashes(chars: &[char], i: usize) -> Option<usize> {
    let hashes = chars[i..].iter().take_while(|c| **c == '#').count();
    (chars.get(i + hashes) == Some(&'"')).then_some(hashes)
}

fn after_raw_text(chars: &[char], i: usize) -> usize {
    let hashes = raw_hashes(chars, i).unwrap_or(0);
    let mut i = i + hashes + 1;
    while i < chars.len() {
        if chars[i] == '"' && chars[i + 1..].iter().take(hashes).filter(|c| **c == '#').count() == hashes {
            return i + 1 + hashes;
        }
        i += 1;
    }
    i
}

fn text(tokens: &[Token], i: usize) -> &str {
    tokens.get(i).map_or("", |token| token.text.as_str())
}

/// Index after the bracket that closes the one at `i`.
fn after_group(tokens: &[Token], mut i: usize) -> usize {
    let mut depth = 0_i32;
    while i < tokens.len() {
        match text(tokens, i) {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth -= 1,
            _ => {}
        }
        i += 1;
        if depth == 0 {
            break;
        }
    }
    i
}

fn without_tests(all: &[Token]) -> Source {
    let mut source = Source { tokens: Vec::new(), test_modules: Vec::new() };
    let mut i = 0;
    while i < all.len() {
        let inner = text(all, i) == "#" && text(all, i + 1) == "!";
        let attribute = if inner { i + 2 } else { i + 1 };
        if text(all, i) != "#" || text(all, attribute) != "[" {
            source.tokens.push(all[i].clone());
            i += 1;
            continue;
        }
        let end = after_group(all, attribute);
        let words = &all[attribute..end];
        let says = |word: &str| words.iter().any(|token| token.text == word);
        if !(text(words, 1) == "cfg" && says("test") && !says("not")) {
            source.tokens.extend_from_slice(&all[i..end]);
            i = end;
        } else if inner {
            return Source { tokens: Vec::new(), ..source };
        } else {
            i = after_item(all, end, &mut source.test_modules);
        }
    }
    source
}

/// Index after the item at `i`; notes a module that lies in a file of its own.
fn after_item(tokens: &[Token], mut i: usize, modules: &mut Vec<String>) -> usize {
    while text(tokens, i) == "#" {
        i = after_group(tokens, i + 1);
    }
    let mut ends_at_brace = true;
    while i < tokens.len() {
        match text(tokens, i) {
            "use" | "static" | "const" | "let" => ends_at_brace = false,
            "fn" | "impl" => ends_at_brace = true,
            "mod" if text(tokens, i + 2) == ";" => modules.push(text(tokens, i + 1).to_owned()),
            ";" => return i + 1,
            "{" if ends_at_brace => return after_group(tokens, i),
            "{" | "(" | "[" => {
                i = after_group(tokens, i);
                continue;
            }
            _ => {}
        }
        i += 1;
    }
    i
}

/// Every path of two or more segments, and every import.
pub fn paths(tokens: &[Token]) -> Vec<Path> {
    let mut found = Vec::new();
    let mut blocks: Vec<Option<String>> = Vec::new();
    let (mut i, mut imported) = (0, false);
    while i < tokens.len() {
        let here = text(tokens, i);
        match here {
            "{" if i >= 2 && text(tokens, i - 2) == "mod" => {
                blocks.push(Some(text(tokens, i - 1).to_owned()))
            }
            "{" => blocks.push(None),
            "}" => drop(blocks.pop()),
            ";" => imported = false,
            "use" => imported = true,
            "extern" if text(tokens, i + 1) == "crate" => {
                imported = true;
                i += 1;
            }
            _ => {
                let before = if i > 0 { text(tokens, i - 1) } else { "" };
                let absolute = here == "::" && (before == "use" || !is_word(before)) && before != ">";
                if absolute || (is_word(here) && before != "::" && before != ".") {
                    let inside: Vec<String> = blocks.iter().flatten().cloned().collect();
                    let first = found.len();
                    i = tree(tokens, if absolute { i + 1 } else { i }, &[], &mut found);
                    found.iter_mut().skip(first).for_each(|path| {
                        (path.absolute, path.imported, path.inside) = (absolute, imported, inside.clone());
                    });
                    continue;
                }
            }
        }
        i += 1;
    }
    found.retain(|path| path.segments.len() > 1 || (path.imported && !path.segments.is_empty()));
    found
}

/// Reads one path or braces full of them, from `i` on; returns the index after it.
fn tree(tokens: &[Token], mut i: usize, prefix: &[String], found: &mut Vec<Path>) -> usize {
    let mut segments = prefix.to_vec();
    let line = tokens.get(i).map_or(0, |token| token.line);
    loop {
        match text(tokens, i) {
            "{" => {
                i += 1;
                while i < tokens.len() && text(tokens, i) != "}" {
                    i = tree(tokens, i, &segments, found);
                    while !matches!(text(tokens, i), "," | "}" | "") {
                        i += 1;
                    }
                    i += usize::from(text(tokens, i) == ",");
                }
                return i + 1;
            }
            word if is_word(word) => {
                segments.push(word.to_owned());
                i += 1;
            }
            "*" => i += 1,
            _ => break,
        }
        if text(tokens, i) != "::" {
            break;
        }
        i += 1;
    }
    let (absolute, imported, inside) = (false, false, Vec::new());
    found.push(Path { line, segments, absolute, imported, inside });
    i.max(1)
}

fn is_word(text: &str) -> bool {
    text.chars().next().is_some_and(|c| c.is_alphabetic() || c == '_')
}
