//! How the texels of a field of scalars lie in memory.

use airlight_core::device::{BrickLayout, FieldFormat, FieldSpec};

use crate::packet::{F, I, LANES, lanes, triple};
use crate::simd::Simd;

/// Texels one after the other, and at least one more behind them.
#[derive(Clone, Copy)]
pub(crate) enum Held<'a> {
    /// 32-bit floats.
    Floats(Floats<'a>),
    /// 16-bit floats.
    Halves(Halves<'a>),
}

/// 32-bit floats.
#[derive(Clone, Copy)]
pub(crate) struct Floats<'a>(&'a [f32]);

/// Two 16-bit floats in the bits of each of these, times a factor.
#[derive(Clone, Copy)]
pub(crate) struct Halves<'a>(&'a [f32], f32);

/// Texels that packets look up two at a time.
pub(crate) trait Pairs: Copy {
    /// The texel at each offset and the one behind it.
    ///
    /// # Safety
    /// Every offset is below the number of texels.
    #[allow(unsafe_code)]
    unsafe fn two<S: Simd>(self, at: I<S>) -> [F<S>; 2];
}

impl Pairs for Floats<'_> {
    #[inline(always)]
    #[allow(unsafe_code)]
    unsafe fn two<S: Simd>(self, at: I<S>) -> [F<S>; 2] {
        // SAFETY: the caller's, and there is one more.
        let [a, b] = unsafe { S::two(self.0, at.0) };
        [F::of(a), F::of(b)]
    }
}

impl Pairs for Halves<'_> {
    #[inline(always)]
    #[allow(unsafe_code)]
    unsafe fn two<S: Simd>(self, at: I<S>) -> [F<S>; 2] {
        // SAFETY: the caller's, and there is one more.
        let [a, b] = unsafe { S::halves(self.0, at.0) };
        [F::of(a) * self.1, F::of(b) * self.1]
    }
}

/// What a half is as a float, where it is a number: its bits in the places of a float's are 2^112 times smaller.
pub(crate) fn half(bits: u16) -> f32 {
    const SHIFT: f32 = f32::from_bits((127 + 112) << 23);
    let magnitude = f32::from_bits(u32::from(bits & 0x7fff) << 13) * SHIFT;
    f32::from_bits(magnitude.to_bits() | u32::from(bits & 0x8000) << 16)
}

impl<'a> Held<'a> {
    /// So many texels of a format in the bits of floats.
    pub(crate) fn new(memory: &'a [f32], format: FieldFormat, count: usize) -> Self {
        assert!(count <= i32::MAX as usize && (count as u64 + 1) * format.bytes() <= size_of_val(memory) as u64);
        match format {
            FieldFormat::Half { .. } => Self::Halves(Halves(memory, format.factor())),
            FieldFormat::Scalar | FieldFormat::Rgba => Self::Floats(Floats(memory)),
        }
    }

    /// Texels one after the other, as many as `count` says, and zeros.
    #[inline(always)]
    pub(crate) fn run<S: Simd>(&self, at: usize, count: usize) -> F<S> {
        if let Self::Floats(Floats(texels)) = *self
            && let Some(run) = texels.get(at..at + LANES)
        {
            let run: &[f32; LANES] = run.try_into().expect("as many as lanes");
            return F::splat(count as f32).gt(F::of(lanes!(i => i as f32))).select(F::of(*run), F::ZERO);
        }
        if let Self::Halves(Halves(pairs, factor)) = *self
            && cfg!(target_endian = "little")
            && let Some(run) = bytemuck::cast_slice::<f32, u16>(pairs).get(at..at + LANES)
        {
            let run = F::of(lanes!(i => half(run[i]))) * factor;
            return F::splat(count as f32).gt(F::of(lanes!(i => i as f32))).select(run, F::ZERO);
        }
        F::of(lanes!(i => if i < count { self.one(at + i) } else { 0.0 }))
    }

    /// A single texel.
    #[inline(always)]
    pub(crate) fn one(&self, at: usize) -> f32 {
        match *self {
            Self::Floats(Floats(texels)) => texels[at],
            Self::Halves(Halves(pairs, factor)) => half((pairs[at / 2].to_bits() >> (at % 2 * 16)) as u16) * factor,
        }
    }
}

/// The index of a field in bricks.
#[derive(Clone, Copy)]
pub(crate) struct Bricks<'a> {
    /// The number of each block's brick, in the bits of floats; each names one.
    index: &'a [f32],
    blocks: [i32; 3],
    /// Texels from one brick to the next.
    pitch: i32,
    bricks: u32,
    constants: u32,
}

impl<'a> Bricks<'a> {
    const SHIFT: u32 = BrickLayout::BLOCK.trailing_zeros();
    const MASK: u32 = BrickLayout::BLOCK - 1;

    /// The index at the start of the memory of a field.
    pub(crate) fn new(memory: &'a [f32], spec: &FieldSpec, layout: BrickLayout) -> Self {
        let blocks = BrickLayout::blocks(spec.dims).map(|b| b as i32);
        let index = &memory[..(BrickLayout::index_bytes(spec.dims) / 4) as usize];
        assert!(index.len() <= i32::MAX as usize);
        let pitch = (BrickLayout::brick_bytes(spec.format) / spec.format.bytes()) as i32;
        Self { index, blocks, pitch, bricks: layout.bricks, constants: layout.constants }
    }

    /// The memory behind the index.
    pub(crate) fn behind(&self, memory: &'a [f32]) -> &'a [f32] {
        &memory[self.index.len()..]
    }

    /// Texels of all bricks.
    pub(crate) fn texels(&self) -> usize {
        self.bricks as usize * self.pitch as usize
    }

    /// The brick of a block.
    #[inline(always)]
    fn brick(&self, [i, j, k]: [u32; 3]) -> u32 {
        let [x, y, _] = self.blocks.map(|b| b as usize);
        self.index[(k as usize * y + j as usize) * x + i as usize].to_bits()
    }

    /// Where a texel lies.
    #[inline(always)]
    pub(crate) fn single(&self, at: [u32; 3]) -> usize {
        let [i, j, k] = triple!(a => (at[a] & Self::MASK) as usize);
        let side = BrickLayout::SIDE as usize;
        self.brick(triple!(a => at[a] >> Self::SHIFT)) as usize * self.pitch as usize + (k * side + j) * side + i
    }

    /// Where the texel of each lane lies, which the field has.
    #[inline(always)]
    pub(crate) fn places<S: Simd>(&self, at: [I<S>; 3]) -> I<S> {
        let block = triple!(a => I::<S>::of(lanes!(i => at[a].0[i] >> Self::SHIFT)));
        let within = triple!(a => I::<S>::of(lanes!(i => at[a].0[i] & Self::MASK as i32)));
        let word = block[0].plus(block[1].plus(block[2].times(self.blocks[1])).times(self.blocks[0]));
        // SAFETY: texels that the field has lie in blocks that it has.
        #[allow(unsafe_code)]
        let bricks = unsafe { S::one(self.index, word.0) };
        let bricks = I::<S>::of(lanes!(i => bricks[i].to_bits() as i32));
        let side = BrickLayout::SIDE as i32;
        bricks.times(self.pitch).plus(within[0]).plus(within[1].plus(within[2].times(side)).times(side))
    }

    /// See [`Scalars::empty`](crate::kernels::field::Scalars::empty).
    #[inline(always)]
    pub(crate) fn empty(&self, at: [u32; 3], texels: &Held<'_>) -> u32 {
        let brick = self.brick(triple!(a => at[a] >> Self::SHIFT));
        if brick < self.constants && texels.one(brick as usize * self.pitch as usize) == 0.0 {
            return BrickLayout::BLOCK - (at[0] & Self::MASK);
        }
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_what_they_stand_for() {
        for (bits, value) in [
            (0x0000, 0.0),
            (0x0001, 2f32.powi(-24)),
            (0x03ff, 1023.0 * 2f32.powi(-24)),
            (0x0400, 2f32.powi(-14)),
            (0x3c00, 1.0),
            (0x3c01, 1.0 + 2f32.powi(-10)),
            (0x7bff, 65504.0),
            (0xc500, -5.0),
        ] {
            assert_eq!(half(bits), value, "{bits:#06x}");
        }
        assert!(half(0x8000).is_sign_negative());
    }
}
