//! Lines of text headers, and the numbers in them.

use super::fault::Fault;

/// The lines of a text header, each with its number and the offset of the byte after it.
pub(super) struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    line: usize,
}

/// The longest line that a header may have; binary data without line ends is longer.
const LONGEST: usize = 64 << 10;

impl<'a> Lines<'a> {
    /// The lines from the first byte on.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0, line: 0 }
    }

    /// Offset of the byte after the line that was given last.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// "line 12": the line that was given last.
    pub(super) fn place(&self) -> String {
        format!("line {}", self.line)
    }

    /// The next line without its end, or none at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<&'a str>, Fault> {
        let left = &self.bytes[self.at..];
        if left.is_empty() {
            return Ok(None);
        }
        self.line += 1;
        let end = left.iter().take(LONGEST).position(|b| *b == b'\n');
        if end.is_none() && left.len() > LONGEST {
            return Err(Fault::at(self.place(), "the header's text does not end in a line end"));
        }
        let line = &left[..end.unwrap_or(left.len())];
        self.at += (line.len() + 1).min(left.len());
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        match std::str::from_utf8(line) {
            Ok(text) => Ok(Some(text)),
            Err(_) => Err(Fault::at(self.place(), "the header is not text here; is it cut or damaged?")),
        }
    }
}

/// One number.
pub(super) fn number<T: std::str::FromStr>(text: &str) -> Result<T, Fault> {
    let text = text.trim();
    text.parse().map_err(|_| Fault::new(format!("'{}' is not such a number as belongs here", shown(text))))
}

/// Numbers with white space between them.
pub(super) fn numbers<T: std::str::FromStr>(text: &str) -> Result<Vec<T>, Fault> {
    text.split_whitespace().map(number).collect()
}

/// Text for a message: not the whole of a damaged line, and nothing that moves a terminal's cursor.
pub(super) fn shown(text: &str) -> String {
    text.chars().take(60).map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}
