//! What the values of a grid mean: from a value to a density and its colours.

use glam::Vec3;

use super::{LARGEST, in_range};

/// What a medium is where the grid has one value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPoint {
    /// The grid's value, in the grid's own unit.
    pub value: f32,
    /// Density, times the medium's extinction; at least 0.
    pub density: f32,
    /// Share of the extinction that scatters, times the medium's albedo; 0 to 1.
    pub albedo: Vec3,
    /// Emission, times the medium's, whatever the density; at least 0.
    pub emission: Vec3,
    /// What the eye sees of the light that is scattered toward it; 0 to 1. Light in the medium knows nothing of it.
    pub tint: Vec3,
}

impl ControlPoint {
    /// White and dark, of a density.
    pub fn new(value: f32, density: f32) -> Self {
        Self { value, density, albedo: Vec3::ONE, emission: Vec3::ZERO, tint: Vec3::ONE }
    }

    /// As it is between two points: `self` + (`to` - `self`) `f`.
    fn toward(&self, to: &Self, f: f32) -> Self {
        let color = |a: Vec3, b: Vec3| a + (b - a) * f;
        Self {
            value: self.value + (to.value - self.value) * f,
            density: self.density + (to.density - self.density) * f,
            albedo: color(self.albedo, to.albedo),
            emission: color(self.emission, to.emission),
            tint: color(self.tint, to.tint),
        }
    }
}

/// A transfer function that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TransferFunctionError {
    /// No points, or too many.
    #[error("{0} points; there must be from 1 to {max}", max = TransferFunction::MOST)]
    Count(usize),
    /// A point that stands before the one ahead of it.
    #[error("point {point} has the value {value}, below the {before} ahead of it; values must ascend")]
    Order {
        /// Its number, from 0.
        point: usize,
        /// Its value.
        value: f32,
        /// The value of the point ahead.
        before: f32,
    },
    /// A number out of range.
    #[error("{what} {value} of point {point}; it must be {right}")]
    Range {
        /// The point's number, from 0.
        point: usize,
        /// Which of its numbers.
        what: &'static str,
        /// What it is.
        value: f32,
        /// What would be right.
        right: &'static str,
    },
}

/// From a value of a grid to density, albedo, emission and tint: linear between control points in ascending order of their values,
/// constant beyond the first and the last. Of points that share a value the last holds there, so that two make a step.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    points: Vec<ControlPoint>,
}

impl TransferFunction {
    /// The most points.
    pub const MOST: usize = 256;

    /// Through `points`.
    ///
    /// # Errors
    /// Too few or too many, values that do not ascend, numbers out of range.
    pub fn new(points: Vec<ControlPoint>) -> Result<Self, TransferFunctionError> {
        if points.is_empty() || points.len() > Self::MOST {
            return Err(TransferFunctionError::Count(points.len()));
        }
        for (point, p) in points.iter().enumerate() {
            let demand = |what, value: f32, right, is: bool| {
                if is { Ok(()) } else { Err(TransferFunctionError::Range { point, what, value, right }) }
            };
            demand("value", p.value, "from -1e15 to 1e15", p.value.abs() <= LARGEST)?;
            demand("density", p.density, "from 0 to 1e15", in_range(p.density))?;
            for channel in 0..3 {
                let share = |v: f32| (0.0..=1.0).contains(&v);
                demand("albedo", p.albedo[channel], "from 0 to 1", share(p.albedo[channel]))?;
                demand("emission", p.emission[channel], "from 0 to 1e15", in_range(p.emission[channel]))?;
                demand("tint", p.tint[channel], "from 0 to 1", share(p.tint[channel]))?;
            }
        }
        match points.windows(2).position(|pair| pair[1].value < pair[0].value) {
            Some(n) => {
                Err(TransferFunctionError::Order { point: n + 1, value: points[n + 1].value, before: points[n].value })
            }
            None => Ok(Self { points }),
        }
    }

    /// The control points.
    pub fn points(&self) -> &[ControlPoint] {
        &self.points
    }

    /// The same with all densities times `factor`.
    ///
    /// # Errors
    /// Densities out of range.
    pub fn denser(self, factor: f32) -> Result<Self, TransferFunctionError> {
        let denser = |p: ControlPoint| ControlPoint { density: p.density * factor, ..p };
        Self::new(self.points.into_iter().map(denser).collect())
    }

    /// What the medium is where the grid has `value`.
    pub fn at(&self, value: f32) -> ControlPoint {
        let below = self.points.iter().filter(|p| p.value <= value).count();
        let (low, high) = (below.max(1) - 1, below.min(self.points.len() - 1));
        let (a, b) = (&self.points[low], &self.points[high]);
        let f = if high > low { (value - a.value) / (b.value - a.value) } else { 0.0 };
        a.toward(b, f)
    }

    /// Whether all that is dense scatters alike and with the medium's own albedo.
    pub(super) fn scatters_alike(&self) -> bool {
        self.points.iter().all(|p| p.albedo == Vec3::ONE)
    }

    /// Whether any point shines.
    pub fn emits(&self) -> bool {
        self.points.iter().any(|p| p.emission != Vec3::ZERO)
    }

    /// Whether what shines is grey.
    pub(super) fn shines_grey(&self) -> bool {
        self.points.iter().all(|p| p.emission == Vec3::splat(p.emission.x))
    }

    /// Whether any point has a tint.
    pub fn tints(&self) -> bool {
        self.points.iter().any(|p| p.tint != Vec3::ONE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp() -> TransferFunction {
        let point = |value, density, red| ControlPoint {
            albedo: Vec3::new(red, 0.5, 1.0),
            emission: Vec3::new(0.0, 2.0 * density, 0.0),
            tint: Vec3::new(1.0, red, 0.25),
            ..ControlPoint::new(value, density)
        };
        TransferFunction::new(vec![
            point(-500.0, 0.5, 0.2),
            point(-100.0, 1.5, 0.6),
            point(-100.0, 3.0, 1.0),
            point(300.0, 4.0, 0.0),
        ])
        .unwrap()
    }

    #[test]
    fn linear_between_points_and_constant_beyond() {
        let ramp = ramp();
        let densities = [-2000.0, -500.0, -300.0, -100.5, -100.0, 0.0, 300.0, 1e9].map(|v| ramp.at(v).density);
        let expected = [0.5, 0.5, 1.0, 1.49875, 3.0, 3.25, 4.0, 4.0];
        for (found, expected) in densities.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-6, "{densities:?}");
        }
        let middle = ramp.at(-300.0);
        assert!((middle.albedo - Vec3::new(0.4, 0.5, 1.0)).length() < 1e-6, "{middle:?}");
        assert!((middle.emission.y - 2.0).abs() < 1e-6 && (middle.tint.y - 0.4).abs() < 1e-6, "{middle:?}");
        assert!((middle.value + 300.0).abs() < 1e-4);
        let one = TransferFunction::new(vec![ControlPoint::new(7.0, 2.0)]).unwrap();
        assert_eq!([-1.0, 7.0, 9.0].map(|v| one.at(v).density), [2.0; 3]);
        assert_eq!(ramp.denser(2.0).unwrap().at(0.0).density, 6.5);
    }

    #[test]
    fn what_cannot_be_is_told_with_its_point() {
        let told = |points| TransferFunction::new(points).unwrap_err().to_string();
        let p = ControlPoint::new;
        assert_eq!(told(vec![]), "0 points; there must be from 1 to 256");
        assert_eq!(told(vec![p(0.0, 0.0); 257]), "257 points; there must be from 1 to 256");
        let unsorted = told(vec![p(0.0, 0.0), p(2.0, 0.0), p(1.0, 0.0)]);
        assert_eq!(unsorted, "point 2 has the value 1, below the 2 ahead of it; values must ascend");
        let negative = told(vec![p(0.0, 0.0), p(2.0, -1.0)]);
        assert_eq!(negative, "density -1 of point 1; it must be from 0 to 1e15");
        assert!(told(vec![p(f32::NAN, 0.0)]).starts_with("value NaN of point 0"));
        let bright = ControlPoint { tint: Vec3::new(0.0, 0.0, 1.5), ..p(0.0, 1.0) };
        assert_eq!(told(vec![bright]), "tint 1.5 of point 0; it must be from 0 to 1");
        let more = ControlPoint { albedo: Vec3::splat(1.1), ..p(0.0, 1.0) };
        assert_eq!(told(vec![more]), "albedo 1.1 of point 0; it must be from 0 to 1");
    }
}
