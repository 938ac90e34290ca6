//! What a render gives.

/// A picture with what a compositor needs beside it. All vectors hold `width · height` pixels, row 0 at the top.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Film {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear RGB radiance (W m⁻² sr⁻¹), premultiplied, and alpha = 1 - mean transmittance.
    pub beauty: Vec<[f32; 4]>,
    /// Transmittance of the medium along the view ray, per channel.
    pub transmittance: Vec<[f32; 3]>,
    /// Mean distance along the view ray of the light that the medium stops, metres; infinite where it stops none.
    pub depth: Vec<f32>,
}

impl Film {
    /// The number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }
}
