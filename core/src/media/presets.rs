//! Transfer functions by name, of airlight's own making: where tissues lie in Hounsfield units (air -1000, lung about -950 to -500,
//! fat -120 to -80, water 0, muscle and organs 20 to 70, contrasted vessels 150 to 400, spongy bone 200 to 700, compact bone above
//! 700) is public; densities and colours are for the eye. No diagnosis is to rest on them.

use glam::Vec3;

use super::{ControlPoint, TransferFunction, TransferFunctionError};

/// A transfer function with a name. Densities are at most 1.
#[derive(Clone, Copy, Debug)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// What it shows.
    pub shows: &'static str,
    /// Values between which its points lie, for data of another scale to be placed by: -1000 and 1000 of a CT, 0 and 1 of an MRI.
    pub range: [f32; 2],
    points: &'static [Point],
}

/// Value, density, albedo, tint.
type Point = (f32, f32, [f32; 3], [f32; 3]);

const CT: [f32; 2] = [-1000.0, 1000.0];
const WHITE: [f32; 3] = [1.0, 1.0, 1.0];
const BONE: [f32; 3] = [0.98, 0.95, 0.9];
const IVORY: [f32; 3] = [1.0, 0.95, 0.84];
const FLESH: [f32; 3] = [0.97, 0.86, 0.82];

impl Preset {
    /// Every preset.
    pub const ALL: [Self; 5] = [
        Self {
            name: "ct-bone",
            shows: "bone alone, spongy bone thinner and warmer than compact bone",
            range: CT,
            points: &[
                (140.0, 0.0, BONE, [0.86, 0.62, 0.5]),
                (250.0, 0.08, BONE, [0.9, 0.72, 0.58]),
                (450.0, 0.4, BONE, IVORY),
                (900.0, 0.9, BONE, IVORY),
                (1600.0, 1.0, BONE, WHITE),
            ],
        },
        Self {
            name: "ct-soft-tissue",
            shows: "muscle and organs as translucent red around bone, fat a faint yellow",
            range: CT,
            points: &[
                (-160.0, 0.0, FLESH, [1.0, 0.85, 0.55]),
                (-100.0, 0.012, FLESH, [1.0, 0.85, 0.55]),
                (-30.0, 0.012, FLESH, [1.0, 0.7, 0.5]),
                (20.0, 0.05, FLESH, [0.92, 0.42, 0.34]),
                (70.0, 0.07, FLESH, [0.85, 0.3, 0.25]),
                (150.0, 0.12, FLESH, [0.9, 0.35, 0.28]),
                (300.0, 0.4, BONE, IVORY),
                (1000.0, 1.0, BONE, WHITE),
            ],
        },
        Self {
            name: "ct-lung",
            shows: "lungs and the walls of their airways as rose mist, all other tissue left clear but for faint bone",
            range: CT,
            points: &[
                (-960.0, 0.0, FLESH, [0.95, 0.75, 0.75]),
                (-880.0, 0.04, FLESH, [0.95, 0.72, 0.72]),
                (-700.0, 0.15, FLESH, [0.96, 0.6, 0.58]),
                (-500.0, 0.3, FLESH, [0.9, 0.45, 0.42]),
                (-350.0, 0.0, FLESH, [0.9, 0.45, 0.42]),
                (200.0, 0.0, BONE, IVORY),
                (400.0, 0.05, BONE, IVORY),
                (1000.0, 0.1, BONE, IVORY),
            ],
        },
        Self {
            name: "ct-skin",
            shows: "the body's surface, opaque from where air ends",
            range: CT,
            points: &[
                (-750.0, 0.0, FLESH, [0.96, 0.78, 0.66]),
                (-400.0, 0.3, FLESH, [0.96, 0.78, 0.66]),
                (-150.0, 1.0, FLESH, [0.94, 0.72, 0.6]),
                (100.0, 1.0, FLESH, [0.9, 0.62, 0.52]),
                (400.0, 1.0, BONE, IVORY),
            ],
        },
        Self {
            name: "mri-t1",
            shows: "a T1-weighted head: fluid left clear, grey matter rose, white matter ivory",
            range: [0.0, 1.0],
            points: &[
                (0.3, 0.0, FLESH, [0.75, 0.5, 0.5]),
                (0.5, 0.06, FLESH, [0.9, 0.42, 0.4]),
                (0.62, 0.3, FLESH, [0.95, 0.55, 0.5]),
                (0.74, 0.5, FLESH, [0.98, 0.72, 0.64]),
                (0.82, 0.85, BONE, [1.0, 0.92, 0.8]),
                (1.0, 1.0, BONE, IVORY),
            ],
        },
    ];

    /// The preset of a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        const ALL: &[Preset] = &Preset::ALL;
        ALL.iter().find(|preset| preset.name == name)
    }

    /// Its transfer function, for data whose values from `low` to `high` are those of [`Preset::range`].
    ///
    /// # Errors
    /// A range that is not finite, or whose ends do not ascend.
    pub fn function(&self, [low, high]: [f32; 2]) -> Result<TransferFunction, TransferFunctionError> {
        let [from, to] = self.range;
        // Exact where nothing is moved.
        let place =
            |v: f32| if [low, high] == self.range { v } else { low + (high - low) * ((v - from) / (to - from)) };
        let point = |&(value, density, albedo, tint): &Point| ControlPoint {
            albedo: Vec3::from(albedo),
            tint: Vec3::from(tint),
            ..ControlPoint::new(place(value), density)
        };
        TransferFunction::new(self.points.iter().map(point).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_a_transfer_function_of_its_name() {
        for preset in Preset::ALL {
            let function = preset.function(preset.range).unwrap();
            assert!(function.points().iter().all(|p| p.density <= 1.0) && function.tints(), "{}", preset.name);
            assert_eq!(Preset::named(preset.name).map(|p| p.shows), Some(preset.shows));
        }
        assert!(Preset::named("ct-bones").is_none());
    }

    #[test]
    fn tissues_are_told_apart() {
        let density = |name: &str, value| Preset::named(name).unwrap().function(CT).unwrap().at(value).density;
        for name in ["ct-bone", "ct-soft-tissue", "ct-lung", "ct-skin"] {
            assert_eq!(density(name, -1000.0), 0.0, "{name}: air");
        }
        assert!(density("ct-bone", 40.0) == 0.0 && density("ct-bone", 1200.0) > 0.9);
        assert!(density("ct-soft-tissue", 50.0) > 0.05 && density("ct-soft-tissue", -90.0) < 0.02);
        assert!(density("ct-lung", -650.0) > 0.1 && density("ct-lung", 40.0) == 0.0);
        assert!(density("ct-skin", 0.0) == 1.0);
    }

    #[test]
    fn data_of_another_scale_is_placed() {
        let placed = |name: &str, range| Preset::named(name).unwrap().function(range).unwrap().points().to_vec();
        assert!((placed("mri-t1", [0.0, 255.0])[1].value - 127.5).abs() < 1e-4);
        let stored = placed("ct-bone", [24.0, 2024.0])[0].value;
        assert!((stored - 1164.0).abs() < 1e-3, "{stored}");
        assert!(Preset::ALL[0].function([1.0, 0.0]).is_err());
    }
}
