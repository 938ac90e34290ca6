//! What stands behind the medium, pixel by pixel.

use std::sync::Arc;

use crate::Version;

/// A picture behind the medium and the distance at which it ends each view ray, for laying a medium over a picture
/// that was made elsewhere.
///
/// With colours it stands in place of a visible environment, also where no surface is. Without, surfaces are black and
/// the environment is seen between them, so that a compositor may put its own picture behind the film by the film's
/// transmittance. Without distances the picture is farther than everything.
#[derive(Clone, Debug)]
pub struct Background {
    width: u32,
    height: u32,
    color: Option<Arc<[[f32; 3]]>>,
    depth: Option<Arc<[f32]>>,
    version: Version,
}

/// A background out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BackgroundError {
    /// Neither colours nor distances.
    #[error("a background of neither colours nor distances")]
    Nothing,
    /// Not as many values as pixels.
    #[error("a background of {width} × {height} pixels with {found} {what}")]
    Size {
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// Values given.
        found: usize,
        /// What they are.
        what: &'static str,
    },
    /// A colour or distance that is none.
    #[error("{what} {value:?} at column {x}, row {y} {right}")]
    Value {
        /// What it is.
        what: &'static str,
        /// The value; distances three times over.
        value: [f32; 3],
        /// Column.
        x: u32,
        /// Row.
        y: u32,
        /// What is wrong with it.
        right: &'static str,
    },
}

impl Background {
    /// The distance from which on there is no surface, metres: beyond every scene, and finite, because the march shows
    /// the environment where the distance is infinite.
    pub const FAR: f32 = 1e30;

    /// A background of `width · height` pixels, row 0 at the top: radiance in linear RGB, W m⁻² sr⁻¹, and distance
    /// along the view ray, metres; [`Background::FAR`] or more, or infinite, where there is no surface.
    ///
    /// # Errors
    /// Neither of both; another number of values; colours that are not finite and at least 0; distances that are
    /// negative or not numbers.
    pub fn new(
        width: u32,
        height: u32,
        color: Option<Vec<[f32; 3]>>,
        depth: Option<Vec<f32>>,
    ) -> Result<Self, BackgroundError> {
        if color.is_none() && depth.is_none() {
            return Err(BackgroundError::Nothing);
        }
        let pixels = u64::from(width) * u64::from(height);
        let counts = [(color.as_ref().map(Vec::len), "colours"), (depth.as_ref().map(Vec::len), "distances")];
        for (found, what) in counts.into_iter().filter_map(|(found, what)| Some((found?, what))) {
            if pixels == 0 || found as u64 != pixels {
                return Err(BackgroundError::Size { width, height, found, what });
            }
        }
        let at = |i: usize| (i as u32 % width, i as u32 / width);
        if let Some(color) = &color
            && let Some(i) = color.iter().position(|texel| texel.iter().any(|c| !(c.is_finite() && *c >= 0.0)))
        {
            let ((x, y), value) = (at(i), color[i]);
            let (what, right) = ("radiance", "is not finite and at least 0");
            return Err(BackgroundError::Value { what, value, x, y, right });
        }
        if let Some(depth) = &depth
            && let Some(i) = depth.iter().position(|d| !Self::is_distance(*d))
        {
            let ((x, y), value) = (at(i), [depth[i]; 3]);
            return Err(BackgroundError::Value { what: "distance", value, x, y, right: "is not at least 0" });
        }
        Ok(Self { width, height, color: color.map(Arc::from), depth: depth.map(Arc::from), version: Version::fresh() })
    }

    /// Whether a distance is one: at least 0, infinity included.
    pub fn is_distance(distance: f32) -> bool {
        distance >= 0.0
    }

    /// Columns.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Radiance of each pixel.
    pub fn color(&self) -> Option<&[[f32; 3]]> {
        self.color.as_deref()
    }

    /// Distance of each pixel, metres.
    pub fn depth(&self) -> Option<&[f32]> {
        self.depth.as_deref()
    }

    /// Identity of the content.
    pub fn version(&self) -> Version {
        self.version
    }

    /// Pixel by pixel what the march takes ([`March::surface`](crate::stage::March::surface)).
    pub fn surfaces(&self) -> impl Iterator<Item = [f32; 4]> {
        (0..self.width as usize * self.height as usize).map(|i| {
            let depth = self.depth.as_ref().map_or(Self::FAR, |depth| depth[i]);
            Self::surface(self.color.as_ref().map(|color| color[i]), depth)
        })
    }

    /// What the march takes for one pixel: a colour is seen at any distance, and without one the environment is where
    /// there is no surface.
    fn surface(color: Option<[f32; 3]>, depth: f32) -> [f32; 4] {
        match color {
            Some([r, g, b]) => [r, g, b, depth.min(Self::FAR)],
            None if depth < Self::FAR => [0.0, 0.0, 0.0, depth],
            None => [0.0, 0.0, 0.0, f32::INFINITY],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_seen_at_any_distance_and_their_absence_shows_the_environment() {
        let depth = vec![2.0, f32::INFINITY, f32::MAX, 0.0];
        let color: Vec<_> = (0..4).map(|i| [i as f32, 0.5, 1.0]).collect();
        let both = Background::new(4, 1, Some(color.clone()), Some(depth.clone())).unwrap();
        let far = Background::FAR;
        let expected = [[0.0, 0.5, 1.0, 2.0], [1.0, 0.5, 1.0, far], [2.0, 0.5, 1.0, far], [3.0, 0.5, 1.0, 0.0]];
        assert_eq!(both.surfaces().collect::<Vec<_>>(), expected);
        let held = Background::new(4, 1, None, Some(depth)).unwrap();
        let distances: Vec<_> = held.surfaces().map(|s| s[3]).collect();
        assert_eq!(distances, [2.0, f32::INFINITY, f32::INFINITY, 0.0]);
        let backdrop = Background::new(2, 2, Some(color), None).unwrap();
        assert!(backdrop.surfaces().all(|s| s[3] == far));
    }

    #[test]
    fn what_is_no_picture_is_refused_with_its_place() {
        assert_eq!(Background::new(2, 2, None, None).unwrap_err(), BackgroundError::Nothing);
        let few = Background::new(2, 3, None, Some(vec![1.0; 5])).unwrap_err().to_string();
        assert_eq!(few, "a background of 2 × 3 pixels with 5 distances");
        let mut color = vec![[1.0; 3]; 6];
        color[5][1] = -1.0;
        let text = Background::new(2, 3, Some(color), None).unwrap_err().to_string();
        assert!(text.contains("column 1, row 2"), "{text}");
        let text = Background::new(3, 2, None, Some(vec![1.0, 0.0, 5.0, f32::NAN, 1.0, 1.0])).unwrap_err().to_string();
        assert!(text.contains("column 0, row 1"), "{text}");
        assert!(Background::new(0, 2, Some(Vec::new()), None).is_err());
    }
}
