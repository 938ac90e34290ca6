//! Media made from grids: a density, and what scatters, absorbs and shines.

use std::sync::{Arc, OnceLock};

use glam::DAffine3;

use super::{Bricks, Grid, IndexBox, LARGEST, Lattice, Medium, MediumError, OpticsField, OpticsFields, in_range};
use crate::Version;
use crate::light::BlackBody;
use crate::once::once;

/// A medium whose density is a [`Grid`], and whose optics may follow more of them. All share one map from index to
/// world; what a grid says outside its bounds is zero of a dense one, of a sparse one its background.
#[derive(Clone, Debug)]
pub struct GridMedium {
    lattice: Lattice,
    window: IndexBox,
    density: Scalars,
    absorption: Option<Scalars>,
    /// Of each channel.
    albedo: Option<[Arc<Grid>; 3]>,
    emission: Option<Scalars>,
    temperature: Option<Temperature>,
    version: Version,
    scattering_version: Version,
    emission_version: Version,
}

/// A grid of densities.
#[derive(Clone, Debug)]
struct Scalars {
    grid: Arc<Grid>,
    /// The largest value.
    most: f32,
    /// What it says in the medium's box, once that was asked for.
    bricks: Arc<OnceLock<Option<Bricks>>>,
}

impl Scalars {
    /// Refuses a grid that cannot be a density.
    fn new(grid: Arc<Grid>) -> Result<Self, MediumError> {
        let mut most = 0.0f32;
        grid.check(|p, value| {
            most = most.max(value);
            if in_range(value) { Ok(()) } else { Err(MediumError::Density { value, x: p.x, y: p.y, z: p.z }) }
        })?;
        Ok(Self { grid, most, bricks: Arc::default() })
    }

    /// The same for another box.
    fn anew(self) -> Self {
        Self { bricks: Arc::default(), ..self }
    }

    fn bricks(&self, window: IndexBox) -> Option<&Bricks> {
        once(&self.bricks, || Bricks::of(&self.grid, window)).as_ref()
    }
}

#[derive(Clone, Debug)]
struct Temperature {
    grid: Arc<Grid>,
    /// Kelvin per unit of the grid.
    scale: f64,
    body: BlackBody,
}

impl GridMedium {
    /// A medium of `density`, with emission proportional to `emission` where that is given. The box of the medium is
    /// the union of the two grids' bounds.
    ///
    /// # Errors
    /// A density that is negative, not finite or above [`LARGEST`]; grids whose indices do not share one map to the
    /// world; a lattice that [`Lattice::new`] refuses.
    pub fn new(density: Arc<Grid>, emission: Option<Arc<Grid>>) -> Result<Self, MediumError> {
        let (bounds, to_world) = (density.bounds(), density.index_to_world());
        let first = DAffine3::from_translation(bounds.min.as_dvec3());
        let medium = Self {
            density: Scalars::new(density)?,
            lattice: Lattice::new(bounds.dims, to_world * first)?,
            window: bounds,
            absorption: None,
            albedo: None,
            emission: None,
            temperature: None,
            version: Version::fresh(),
            scattering_version: Version::fresh(),
            emission_version: Version::fresh(),
        };
        let Some(emission) = emission else { return Ok(medium) };
        medium.share(&emission, "emission")?;
        let bounds = emission.bounds();
        Self { emission: Some(Scalars::new(emission)?), ..medium }.over(bounds)
    }

    /// The same with a density ρa of its own that absorbs and does not scatter: extinction follows ρ + ρa, scattering
    /// ρ alone, and so does emission without a grid of its own. The medium's box grows to hold the grid.
    ///
    /// # Errors
    /// As [`GridMedium::new`].
    pub fn with_absorption(self, absorption: Arc<Grid>) -> Result<Self, MediumError> {
        self.share(&absorption, "absorption")?;
        let bounds = absorption.bounds();
        Self { absorption: Some(Scalars::new(absorption)?), ..self }.over(bounds)
    }

    /// The same with shares from 0 to 1 that multiply the albedo, one grid for each channel: what scatters is their
    /// product with the density, voxel by voxel. Nothing else changes.
    ///
    /// # Errors
    /// A share out of range; as [`GridMedium::new`].
    pub fn with_albedo(self, albedo: [Arc<Grid>; 3]) -> Result<Self, MediumError> {
        for (c, grid) in albedo.iter().enumerate() {
            // One grid of all three channels is looked at once.
            if albedo[..c].iter().all(|other| !Arc::ptr_eq(other, grid)) {
                self.share(grid, "albedo")?;
                check_values(grid, "albedo", 1.0, 1.0)?;
            }
        }
        Ok(Self { albedo: Some(albedo), scattering_version: Version::fresh(), ..self })
    }

    /// The same with a temperature, `scale` kelvin per unit of the grid, whose black body colours the emission, relative
    /// to the luminance at `reference` kelvin ([`BlackBody`]). What shines is the product with the density of emission,
    /// voxel by voxel.
    ///
    /// # Errors
    /// A temperature that is not from 0 to [`BlackBody::HOTTEST`]; as [`GridMedium::new`].
    pub fn with_temperature(self, grid: Arc<Grid>, scale: f64, reference: f64) -> Result<Self, MediumError> {
        self.share(&grid, "temperature")?;
        check_values(&grid, "temperature in kelvin", scale, BlackBody::HOTTEST)?;
        let temperature = Some(Temperature { grid, scale, body: BlackBody::new(reference) });
        Ok(Self { temperature, emission_version: Version::fresh(), ..self })
    }

    /// Whether emission follows a grid of its own.
    pub(super) fn has_emission(&self) -> bool {
        self.emission.is_some()
    }

    /// Refuses a grid on another lattice.
    fn share(&self, grid: &Grid, what: &str) -> Result<(), MediumError> {
        if grid.index_to_world() == self.density.grid.index_to_world() {
            return Ok(());
        }
        let what = format!("the grids of density and {what} must share one transform from index to world");
        Err(MediumError::Mismatch(what))
    }

    /// The medium in a box that holds `bounds` too.
    fn over(self, bounds: IndexBox) -> Result<Self, MediumError> {
        let window = self.window.union(bounds);
        let to_window = DAffine3::from_translation(window.min.as_dvec3());
        let lattice = Lattice::new(window.dims, self.density.grid.index_to_world() * to_window)?;
        let [version, scattering_version, emission_version] = [(); 3].map(|()| Version::fresh());
        let (density, emission) = (self.density.anew(), self.emission.map(Scalars::anew));
        Ok(Self { lattice, window, density, emission, version, scattering_version, emission_version, ..self })
    }

    /// Slice `k` of a grid over the medium's box.
    fn write(&self, grid: &Grid, k: u32, out: &mut [f32]) {
        grid.write_slice(self.window, self.window.min.z + k as i32, out);
    }

    fn read(&self, grid: &Grid, k: u32) -> Vec<f32> {
        let mut slice = vec![0.0; self.window.dims.x as usize * self.window.dims.y as usize];
        self.write(grid, k, &mut slice);
        slice
    }

    fn scattering_slice(&self, k: u32, out: &mut [f32]) {
        let density = self.read(&self.density.grid, k);
        for (voxel, &rho) in out.chunks_exact_mut(4).zip(&density) {
            voxel.copy_from_slice(&[rho, rho, rho, 0.0]);
        }
        let Some(albedo) = &self.albedo else { return };
        let mut shares = self.read(&albedo[0], k);
        for c in 0..3 {
            if c > 0 && !Arc::ptr_eq(&albedo[c], &albedo[c - 1]) {
                self.write(&albedo[c], k, &mut shares);
            }
            out.iter_mut().skip(c).step_by(4).zip(&shares).for_each(|(v, share)| *v *= share);
        }
    }

    fn shining(&self) -> &Scalars {
        self.emission.as_ref().unwrap_or(&self.density)
    }

    fn glow_slice(&self, Temperature { grid, scale, body }: &Temperature, k: u32, out: &mut [f32]) {
        let (shining, heat) = (self.read(&self.shining().grid, k), self.read(grid, k));
        for (voxel, (&rho, &value)) in out.chunks_exact_mut(4).zip(shining.iter().zip(&heat)) {
            voxel.fill(0.0);
            if rho > 0.0 {
                let glow =
                    (body.color(f64::from(value) * scale) * f64::from(rho)).min(glam::DVec3::splat(LARGEST.into()));
                voxel[..3].copy_from_slice(&glow.as_vec3().to_array());
            }
        }
    }
}

/// Refuses a grid whose values, times `scale`, are not from 0 to `most`.
fn check_values(grid: &Grid, what: &'static str, scale: f64, most: f64) -> Result<(), MediumError> {
    grid.check(|p, value| {
        let value = f64::from(value) * scale;
        let right = (0.0..=most).contains(&value);
        if right { Ok(()) } else { Err(MediumError::Value { what, value, most, x: p.x, y: p.y, z: p.z }) }
    })
}

impl Medium for GridMedium {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_slice(&self, k: u32, out: &mut [f32]) {
        self.write(&self.density.grid, k, out);
        if let Some(absorption) = &self.absorption {
            let absorption = self.read(&absorption.grid, k);
            out.iter_mut().zip(&absorption).for_each(|(v, more)| *v = (*v + more).min(LARGEST));
        }
    }

    fn density_bound(&self) -> Option<f32> {
        let more = self.absorption.as_ref().map_or(0.0, |absorption| absorption.most);
        Some((self.density.most + more).min(LARGEST))
    }

    fn density_bricks(&self) -> Option<&Bricks> {
        // The sum of two grids is laid out.
        if self.absorption.is_some() { None } else { self.density.bricks(self.window) }
    }

    fn optics_fields(&self) -> OpticsFields<'_> {
        let scatters_alike = self.albedo.is_none() && self.absorption.is_none();
        // Where it has colour, the density itself says where there is any, unless emission has a grid of its own.
        let shines_alike = !self.has_emission() && (self.absorption.is_none() || self.temperature.is_some());
        OpticsFields {
            scattering: (!scatters_alike)
                .then(|| OpticsField::new(self.scattering_version, |k, out| self.scattering_slice(k, out))),
            emission: (!shines_alike).then(|| {
                let shining = self.shining();
                OpticsField::new(self.emission_version, |k, out| self.write(&shining.grid, k, out))
                    .held_as(shining.most, || shining.bricks(self.window))
            }),
            emission_color: self.temperature.as_ref().map(|temperature| {
                OpticsField::new(self.emission_version, move |k, out| self.glow_slice(temperature, k, out))
            }),
            seen: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{IVec3, UVec3};

    use super::*;
    use crate::media::Storage;

    const DIMS: UVec3 = UVec3::new(2, 3, 4);

    fn grid(value: impl Fn(usize) -> f32) -> Arc<Grid> {
        Arc::new(Grid::dense(DIMS, DAffine3::IDENTITY, (0..24).map(value).collect()).unwrap())
    }

    fn slice(field: &OpticsField<'_>, k: u32, values: usize) -> Vec<f32> {
        let mut out = vec![9.0; 6 * values];
        field.slice(k, &mut out);
        out
    }

    #[test]
    fn densities_are_judged_with_their_place() {
        for bad in [f32::NAN, -1.0, f32::INFINITY, 1e16] {
            let broken = || grid(|n| if n == 1 + 2 + 12 { bad } else { 0.0 });
            let medium = || GridMedium::new(grid(|_| 1.0), None).unwrap();
            for error in [
                GridMedium::new(broken(), None).unwrap_err(),
                GridMedium::new(grid(|_| 1.0), Some(broken())).unwrap_err(),
                medium().with_absorption(broken()).unwrap_err(),
            ] {
                assert!(matches!(error, MediumError::Density { x: 1, y: 1, z: 2, .. }), "{error}");
            }
            let albedo = [grid(|_| 1.0), broken(), grid(|_| 0.0)];
            let error = medium().with_albedo(albedo).unwrap_err().to_string();
            assert!(error.contains("albedo") && error.contains("voxel (1, 1, 2); it must be from 0 to 1"), "{error}");
            let error = medium().with_temperature(broken(), 1.0, 1500.0).unwrap_err().to_string();
            assert!(error.contains("voxel (1, 1, 2); it must be from 0 to 100000"), "{error}");
        }
        let warm = GridMedium::new(grid(|_| 1.0), None).unwrap();
        assert!(warm.clone().with_temperature(grid(|_| 2.0), 5e4, 1500.0).is_ok());
        assert!(warm.with_temperature(grid(|_| 2.1), 5e4, 1500.0).is_err());
    }

    #[test]
    fn grids_share_a_lattice() {
        let other = Grid::dense(DIMS, DAffine3::from_translation(glam::DVec3::X), vec![0.5; 24]).unwrap();
        let other = Arc::new(other);
        let medium = || GridMedium::new(grid(|_| 1.0), None).unwrap();
        for (error, what) in [
            (GridMedium::new(grid(|_| 1.0), Some(other.clone())).unwrap_err(), "emission"),
            (medium().with_absorption(other.clone()).unwrap_err(), "absorption"),
            (medium().with_albedo([other.clone(), other.clone(), other.clone()]).unwrap_err(), "albedo"),
            (medium().with_temperature(other.clone(), 1.0, 1500.0).unwrap_err(), "temperature"),
        ] {
            let expected = format!("the grids of density and {what} must share one transform from index to world");
            assert_eq!(error.to_string(), expected);
        }
    }

    #[test]
    fn what_absorbs_adds_to_the_density_and_scatters_nothing() {
        let medium = GridMedium::new(grid(|n| n as f32), None).unwrap();
        let absorption = Grid::new(
            IndexBox { min: IVec3::new(0, 0, -1), dims: DIMS },
            DAffine3::IDENTITY,
            Storage::Dense(vec![0.5; 24]),
        );
        let medium = medium.with_absorption(Arc::new(absorption.unwrap())).unwrap();
        assert_eq!(medium.lattice().dims(), UVec3::new(2, 3, 5));
        let mut density = [0.0; 6];
        let mut slices = |k| {
            medium.density_slice(k, &mut density);
            density
        };
        assert_eq!(slices(0), [0.5; 6]);
        assert_eq!(slices(1), [0.5, 1.5, 2.5, 3.5, 4.5, 5.5]);
        assert_eq!(slices(4), [18.0, 19.0, 20.0, 21.0, 22.0, 23.0]);
        let fields = medium.optics_fields();
        let scattering = fields.scattering.unwrap();
        assert_eq!(slice(&scattering, 0, 4), [0.0; 24]);
        assert_eq!(slice(&scattering, 1, 4)[20..], [5.0, 5.0, 5.0, 0.0]);
        // Emission follows what scatters and absorbs, not what absorbs alone.
        assert_eq!(slice(&fields.emission.unwrap(), 1, 1), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn shares_multiply_each_channel() {
        let medium = GridMedium::new(grid(|n| n as f32), None).unwrap();
        assert!(medium.optics_fields().scattering.is_none());
        let (half, ramp) = (grid(|_| 0.5), grid(|n| n as f32 / 24.0));
        let scattering = |albedo| {
            let medium = medium.clone().with_albedo(albedo).unwrap();
            slice(&medium.optics_fields().scattering.unwrap(), 1, 4)
        };
        let colored = scattering([half.clone(), ramp.clone(), half.clone()]);
        assert_eq!(colored[4 * 3..4 * 4], [4.5, 9.0 * 9.0 / 24.0, 4.5, 0.0]);
        let grey = scattering([ramp.clone(), ramp.clone(), ramp]);
        assert_eq!(grey[4 * 5..], [[11.0f32 * (11.0 / 24.0); 3].as_slice(), &[0.0]].concat()[..]);
    }

    #[test]
    fn temperature_colors_what_shines() {
        let heat = || grid(|n| 100.0 * n as f32);
        let plain = GridMedium::new(grid(|_| 2.0), None).unwrap();
        let medium = plain.clone().with_temperature(heat(), 1.5, 1800.0).unwrap();
        let fields = medium.optics_fields();
        assert!(fields.emission.is_none() && fields.scattering.is_none());
        let glow = slice(&fields.emission_color.unwrap(), 2, 4);
        let expected = 2.0 * BlackBody::new(1800.0).color(1500.0 * 1.5);
        for c in 0..3 {
            assert!((f64::from(glow[4 * (15 - 12) + c]) / expected[c] - 1.0).abs() < 1e-6, "{glow:?} {expected}");
        }
        // Cold things are dark, and where nothing shines nothing is hot.
        assert_eq!(slice(&medium.optics_fields().emission_color.unwrap(), 0, 4)[..12], [0.0; 12]);
        let own = GridMedium::new(grid(|_| 2.0), Some(grid(|n| if n == 23 { 3.0 } else { 0.0 }))).unwrap();
        let own = own.with_temperature(heat(), 1.0, 1800.0).unwrap();
        let fields = own.optics_fields();
        let glow = slice(&fields.emission_color.unwrap(), 3, 4);
        assert!(glow[..20].iter().all(|v| *v == 0.0) && glow[20] > 0.0, "{glow:?}");
        assert_eq!(slice(&fields.emission.unwrap(), 3, 1), [0.0, 0.0, 0.0, 0.0, 0.0, 3.0]);
    }

    #[test]
    fn only_what_changes_takes_a_new_version() {
        let medium = GridMedium::new(grid(|_| 1.0), Some(grid(|_| 0.5))).unwrap();
        let versions = |medium: &GridMedium| {
            let fields = medium.optics_fields();
            (medium.version(), fields.emission.unwrap().version(), fields.scattering.map(|field| field.version()))
        };
        let half = grid(|_| 0.5);
        let shared = medium.clone().with_albedo([half.clone(), half.clone(), half.clone()]).unwrap();
        let (density, emission, scattering) = versions(&shared);
        assert_eq!((density, emission), (medium.version(), versions(&medium).1));
        let again = shared.clone().with_albedo([half.clone(), half.clone(), half.clone()]).unwrap();
        assert_ne!(versions(&again).2, scattering);
        let hot = shared.clone().with_temperature(grid(|_| 900.0), 1.0, 1500.0).unwrap();
        assert_eq!((versions(&hot).0, versions(&hot).2), (density, scattering));
        assert_ne!(versions(&hot).1, emission);
        let absorbing = shared.with_absorption(half).unwrap();
        assert_ne!(versions(&absorbing).0, density);
        assert_ne!(versions(&absorbing).2, scattering);
    }
}
