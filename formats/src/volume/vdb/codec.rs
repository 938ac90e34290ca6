//! The values of one node: their active mask, their inactive values and their packing.

use flate2::{Decompress, FlushDecompress, Status};
use half::f16;

use super::super::bytes::Reader;
use super::super::fault::Fault;
use super::{ACTIVE_MASK, BLOSC, NODE_MASK_VERSION, ZIP, blosc};

/// How inactive values are told where only active ones are stored; the byte before a node's values.
const MINUS_BACKGROUND: u8 = 1;
const ONE_INACTIVE: u8 = 2;
const MASK_OF_BACKGROUNDS: u8 = 3;
const MASK_AND_ONE: u8 = 4;
const MASK_AND_TWO: u8 = 5;
const ALL_VALUES: u8 = 6;

/// Whether bit `n` of a mask is set.
pub(super) fn is_on(mask: &[u8], n: usize) -> bool {
    mask[n >> 3] >> (n & 7) & 1 != 0
}

/// Reads the values of a grid's nodes, one node after the other.
pub(super) struct Codec {
    /// The file's version.
    pub(super) version: u32,
    /// The value of what the tree leaves out.
    pub(super) background: f32,
    compression: u32,
    half: bool,
    stored: Vec<f32>,
    bytes: Vec<u8>,
    inflater: Decompress,
}

impl Codec {
    /// For a grid of these compression flags.
    pub(super) fn new(version: u32, compression: u32, half: bool) -> Self {
        let inflater = Decompress::new(true);
        Self { version, background: 0.0, compression, half, stored: Vec::new(), bytes: Vec::new(), inflater }
    }

    /// Reads a node's values into `out`; `active` has a bit for each.
    pub(super) fn values(&mut self, r: &mut Reader<'_>, active: &[u8], out: &mut [f32]) -> Result<(), Fault> {
        let packing = if self.version >= NODE_MASK_VERSION { r.u8()? } else { ALL_VALUES };
        if packing > ALL_VALUES {
            return Err(r.fault(format!("{packing} is no way to store inactive values")));
        }
        // Inactive values are the first or, where the mask is set, the second of these.
        let mut inactive = [self.background; 2];
        if matches!(packing, MINUS_BACKGROUND | MASK_OF_BACKGROUNDS) {
            inactive[0] = -self.background;
        }
        if matches!(packing, ONE_INACTIVE | MASK_AND_ONE | MASK_AND_TWO) {
            inactive[0] = r.f32()?;
        }
        if packing == MASK_AND_TWO {
            inactive[1] = r.f32()?;
        }
        let mask = match packing {
            MASK_OF_BACKGROUNDS | MASK_AND_ONE | MASK_AND_TWO => Some(r.take(active.len())?),
            _ => None,
        };
        let only_active = self.compression & ACTIVE_MASK != 0 && packing != ALL_VALUES;
        let on = active.iter().map(|b| b.count_ones() as usize).sum();
        let count = if only_active { on } else { out.len() };
        let at = r.at();
        self.array(r, count).map_err(|fault| fault.within(&format!("byte {at}")))?;
        if count == out.len() {
            out.copy_from_slice(&self.stored);
            return Ok(());
        }
        let mut stored = self.stored.iter();
        for (n, value) in out.iter_mut().enumerate() {
            *value = match is_on(active, n) {
                true => stored.next().copied().unwrap_or(self.background),
                false => inactive[usize::from(mask.is_some_and(|mask| is_on(mask, n)))],
            };
        }
        Ok(())
    }

    /// Reads `count` numbers into `self.stored`.
    fn array(&mut self, r: &mut Reader<'_>, count: usize) -> Result<(), Fault> {
        self.stored.clear();
        // Of no half values not even the packed size is written.
        if self.half && count == 0 {
            return Ok(());
        }
        let size = count * if self.half { 2 } else { 4 };
        let raw = if self.compression & (ZIP | BLOSC) == 0 {
            r.take(size)?
        } else {
            // A size of zero or less means that packing did not pay, and so many bytes are stored as they are.
            let packed = r.i64()?;
            if packed <= 0 {
                if packed.unsigned_abs() != size as u64 {
                    return Err(Fault::new(format!("{} stored bytes, where {size} belong", packed.unsigned_abs())));
                }
                r.take(size)?
            } else {
                let packed = r.take(usize::try_from(packed).unwrap_or(usize::MAX))?;
                if self.compression & BLOSC != 0 {
                    blosc::unpack(packed, size, &mut self.bytes)?;
                } else {
                    self.inflate(packed, size)?;
                }
                &self.bytes[..]
            }
        };
        if self.half {
            self.stored.extend(raw.as_chunks::<2>().0.iter().map(|b| f16::from_le_bytes(*b).to_f32()));
        } else {
            self.stored.extend(raw.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)));
        }
        Ok(())
    }

    /// Unpacks a zlib stream of exactly `size` bytes into `self.bytes`.
    fn inflate(&mut self, packed: &[u8], size: usize) -> Result<(), Fault> {
        self.bytes.clear();
        self.bytes.resize(size, 0);
        self.inflater.reset(true);
        let status = self.inflater.decompress(packed, &mut self.bytes, FlushDecompress::Finish);
        match status {
            Ok(Status::StreamEnd) if self.inflater.total_out() == size as u64 => Ok(()),
            Ok(_) => Err(Fault::new(format!(
                "{} bytes came out of the zip data, where {size} belong",
                self.inflater.total_out()
            ))),
            Err(e) => Err(Fault::new(format!("the zip data is damaged: {e}"))),
        }
    }
}
