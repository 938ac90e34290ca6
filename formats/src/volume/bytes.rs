//! Reading numbers from a slice that may end too soon.

use super::fault::Fault;

/// A position in a file's bytes. Every read is checked against the end.
#[derive(Clone)]
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

macro_rules! numbers {
    ($($name:ident: $type:ty),*) => {
        $(pub(super) fn $name(&mut self) -> Result<$type, Fault> {
            self.array().map(<$type>::from_le_bytes)
        })*
    };
}

impl<'a> Reader<'a> {
    /// Starts at the beginning of `bytes`.
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Starts at byte `at`, which must lie in `bytes`.
    pub(super) fn starting_at(bytes: &'a [u8], at: i64) -> Result<Self, Fault> {
        match usize::try_from(at) {
            Ok(at) if at <= bytes.len() => Ok(Self { bytes, at }),
            _ => Err(Fault::new(format!("an offset points to byte {at}, but the file has {} bytes", bytes.len()))),
        }
    }

    /// The offset of the next byte.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// A fault at the next byte.
    pub(super) fn fault(&self, what: impl Into<String>) -> Fault {
        Fault::at(format!("byte {}", self.at), what)
    }

    /// The next `count` bytes.
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], Fault> {
        let left = &self.bytes[self.at..];
        let taken = left.get(..count).ok_or_else(|| {
            self.fault(format!("the data is cut short: {count} more bytes belong here, {} are left", left.len()))
        })?;
        self.at += count;
        Ok(taken)
    }

    /// The next `N` bytes.
    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], Fault> {
        let mut out = [0; N];
        out.copy_from_slice(self.take(N)?);
        Ok(out)
    }

    numbers!(u8: u8, u32: u32, i32: i32, i64: i64, f32: f32, f64: f64);

    /// Text after its length as 32 bits.
    pub(super) fn string(&mut self) -> Result<String, Fault> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }
}
