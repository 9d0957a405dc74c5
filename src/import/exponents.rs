//! Numbers with an exponent, letter by letter. The JSON reader keeps the text of every number but these: it makes `1e+5` of
//! `1e5` and of `1E5`.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;

/// How a file writes its numbers with an exponent, in their order, by what the JSON reader makes of them; empty where it
/// leaves all as they are.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exponents(BTreeMap<String, VecDeque<String>>);

impl Exponents {
    /// Those of JSON that is whole.
    pub(super) fn of(json: &[u8]) -> Self {
        let mut found = Self::default();
        let mut changed = false;
        for range in with_exponent(json) {
            let text = String::from_utf8_lossy(&json[range]).into_owned();
            let Ok(read) = text.parse::<serde_json::Number>().map(|number| number.to_string()) else {
                continue;
            };
            changed |= read != text;
            found.0.entry(read).or_default().push_back(text);
        }
        if changed { found } else { Self::default() }
    }

    /// The same JSON, written anew, with the texts that the file had. Where it wrote one number in several ways, they are
    /// told apart by their order.
    pub(crate) fn restore(&self, json: Vec<u8>) -> Vec<u8> {
        if self.0.is_empty() {
            return json;
        }
        let (mut left, mut end) = (self.0.clone(), 0);
        let mut restored = Vec::with_capacity(json.len());
        for range in with_exponent(&json) {
            let text = std::str::from_utf8(&json[range.clone()]).unwrap_or_default();
            let Some(texts) = left.get_mut(text) else { continue };
            restored.extend_from_slice(&json[end..range.start]);
            restored.extend_from_slice(texts[0].as_bytes());
            end = range.end;
            // The last one serves what was copied, too.
            if texts.len() > 1 {
                texts.pop_front();
            }
        }
        restored.extend_from_slice(&json[end..]);
        restored
    }
}

/// Where they stand.
fn with_exponent(json: &[u8]) -> Vec<Range<usize>> {
    let (mut found, mut at) = (Vec::new(), 0);
    while at < json.len() {
        let begin = at;
        match json[at] {
            b'"' => {
                at += 1;
                while at < json.len() && json[at] != b'"' {
                    at += if json[at] == b'\\' { 2 } else { 1 };
                }
                at += 1;
            }
            b'-' | b'0'..=b'9' => {
                let in_number = |byte: &u8| matches!(byte, b'0'..=b'9' | b'+' | b'-' | b'.' | b'e' | b'E');
                at += json[at..].iter().take_while(|byte| in_number(byte)).count();
                if json[begin..at].iter().any(|byte| matches!(byte, b'e' | b'E')) {
                    found.push(begin..at);
                }
            }
            _ => at += 1,
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_number_comes_out_as_it_went_in() {
        for json in [
            r#"{"a":[1e5,1E5,1e+5,-2.50E-07,3e-2,1e05,0e0],"1e5":"1e5 \" 1E5 \\","b":{"c":1E5,"d":1.0,"e":1e999}}"#,
            r#"[1.5e3,"\\",1.5E3]"#,
            "7e2",
            "{}",
        ] {
            let value: serde_json::Value = serde_json::from_str(json).unwrap();
            let written = serde_json::to_vec(&value).unwrap();
            assert_eq!(String::from_utf8(Exponents::of(json.as_bytes()).restore(written)).unwrap(), json);
        }
    }

    #[test]
    fn what_is_not_the_files_stays() {
        let exponents = Exponents::of(b"[1E5]");
        assert_eq!(exponents.restore(b"[1e16,1e+5,[1e+5,1e+6]]".to_vec()), b"[1e16,1E5,[1E5,1e+6]]");
        assert_eq!(Exponents::of(b"[1e-5, 2.5, \"1e5\"]"), Exponents::default());
    }
}
