//! Text and JSON on standard output.

use std::io::Write;

use crate::failure::Failure;

/// Prints a line. A reader that has gone away (`airlight info … | head`) ends the program quietly.
pub(crate) fn line(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => Err(Failure::running(format!("standard output: {e}"))),
        _ => Ok(()),
    }
}

/// Prints a JSON document.
pub(crate) fn json(value: &serde_json::Value) -> Result<(), Failure> {
    line(&format!("{value:#}"))
}

/// Prints a line on standard error. There is nobody to tell where that is closed.
pub(crate) fn remark(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

/// A float for JSON: numbers that JSON does not have become strings.
pub(crate) fn number(v: f64) -> serde_json::Value {
    serde_json::Number::from_f64(v).map_or_else(|| serde_json::Value::String(v.to_string()), Into::into)
}

/// Three numbers, shortened.
pub(crate) fn triple(v: impl Into<[f64; 3]>) -> String {
    let [x, y, z] = v.into().map(short);
    format!("{x} {y} {z}")
}

/// A number in at most six significant digits.
pub(crate) fn short(v: f64) -> String {
    if v == 0.0 || !v.is_finite() {
        return v.to_string();
    }
    let digits = (5 - v.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{v:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!(short(0.1), "0.1");
        assert_eq!(short(1234567.0), "1234567");
        assert_eq!(short(1.0 / 3.0), "0.333333");
        assert_eq!(short(-0.000012345678), "-0.0000123457");
    }
}
