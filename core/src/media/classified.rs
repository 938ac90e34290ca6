//! Media whose grid holds values of any kind, and a transfer function that says what they mean.

use std::sync::Arc;

use glam::Vec3;

use super::{
    ControlPoint, DensitySource, Grid, IndexBox, Lattice, Medium, MediumError, OpticsField, OpticsFields,
    TransferFunction,
};
use crate::Version;

/// A grid of values, such as the Hounsfield units of a CT, and what each value is as a medium. Voxels are classified, and
/// what they are is interpolated between them: values themselves never are.
#[derive(Clone, Debug)]
pub struct Classified {
    lattice: Lattice,
    window: IndexBox,
    values: Arc<Grid>,
    values_version: Version,
    function: TransferFunction,
    version: Version,
    scattering_version: Version,
    emission_version: Version,
    seen_version: Version,
}

impl Classified {
    /// The medium of `values`.
    ///
    /// # Errors
    /// A value that is not finite; a grid that makes no lattice.
    pub fn new(values: Arc<Grid>, function: TransferFunction) -> Result<Self, MediumError> {
        values.check(|p, value| {
            if value.is_finite() { Ok(()) } else { Err(MediumError::NotFinite { value, x: p.x, y: p.y, z: p.z }) }
        })?;
        let window = values.bounds();
        let to_window = glam::DAffine3::from_translation(window.min.as_dvec3());
        let lattice = Lattice::new(window.dims, values.index_to_world() * to_window)?;
        let [values_version, version, scattering_version, emission_version, seen_version] =
            [(); 5].map(|()| Version::fresh());
        Ok(Self {
            lattice,
            window,
            values,
            values_version,
            function,
            version,
            scattering_version,
            emission_version,
            seen_version,
        })
    }

    /// The same values with another meaning. What it leaves as it was keeps its version.
    pub fn with_function(&self, function: TransferFunction) -> Self {
        let (old, new) = (self.function.points(), function.points());
        let changes = |of: fn(&ControlPoint) -> [Vec3; 2]| {
            let same = |(a, b): (&ControlPoint, &ControlPoint)| a.value == b.value && of(a) == of(b);
            old.len() != new.len() || !old.iter().zip(new).all(same)
        };
        let density = changes(|p| [Vec3::splat(p.density), Vec3::ZERO]);
        let albedo = density || changes(|p| [p.albedo, Vec3::ZERO]);
        let kept = |version, changed| if changed { Version::fresh() } else { version };
        Self {
            version: kept(self.version, density),
            scattering_version: kept(self.scattering_version, albedo),
            emission_version: kept(self.emission_version, changes(|p| [p.emission, Vec3::ZERO])),
            seen_version: kept(self.seen_version, albedo || changes(|p| [p.tint, Vec3::ZERO])),
            function,
            ..self.clone()
        }
    }

    /// What the values mean.
    pub fn function(&self) -> &TransferFunction {
        &self.function
    }

    /// Identity of the values.
    pub fn values_version(&self) -> Version {
        self.values_version
    }

    /// Writes the values of slice `k`, x fastest; `out` holds dims.x · dims.y of them.
    pub fn values_slice(&self, k: u32, out: &mut [f32]) {
        self.values.write_slice(self.window, self.window.min.z + k as i32, out);
    }

    fn each(&self, k: u32, out: &mut [f32], size: usize, write: impl Fn(ControlPoint, &mut [f32])) {
        let mut values = vec![0.0; out.len() / size];
        self.values_slice(k, &mut values);
        out.chunks_exact_mut(size).zip(values).for_each(|(voxel, value)| write(self.function.at(value), voxel));
    }

    /// A field of colours.
    fn colors(&self, version: Version, color: impl Fn(ControlPoint) -> Vec3 + 'static) -> OpticsField<'_> {
        OpticsField::new(version, move |k, out| {
            self.each(k, out, 4, |p, voxel| voxel.copy_from_slice(&color(p).extend(0.0).to_array()));
        })
    }
}

impl Medium for Classified {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_slice(&self, k: u32, out: &mut [f32]) {
        self.each(k, out, 1, |p, voxel| voxel[0] = p.density);
    }

    fn source(&self) -> DensitySource<'_> {
        DensitySource::Classified(self)
    }

    fn optics_fields(&self) -> OpticsFields<'_> {
        let function = &self.function;
        OpticsFields {
            scattering: (!function.scatters_alike())
                .then(|| self.colors(self.scattering_version, |p| p.density * p.albedo)),
            emission: Some(OpticsField::new(self.emission_version, |k, out| {
                self.each(k, out, 1, |p, voxel| voxel[0] = p.emission.max_element());
            })),
            emission_color: (!function.shines_grey()).then(|| self.colors(self.emission_version, |p| p.emission)),
            seen: function.tints().then(|| self.colors(self.seen_version, |p| p.density * p.albedo * p.tint)),
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, IVec3, UVec3};

    use super::*;
    use crate::media::Storage;

    fn values() -> Arc<Grid> {
        let bounds = IndexBox { min: IVec3::new(-3, 2, 0), dims: UVec3::new(2, 3, 4) };
        let storage = Storage::Dense((0..24).map(|n| 100.0 * n as f32 - 1000.0).collect());
        Arc::new(Grid::new(bounds, DAffine3::IDENTITY, storage).unwrap())
    }

    fn point(value: f32, density: f32) -> ControlPoint {
        ControlPoint {
            albedo: Vec3::new(0.5, 1.0, 0.25),
            tint: Vec3::new(1.0, 0.5, 1.0),
            ..ControlPoint::new(value, density)
        }
    }

    fn medium(points: Vec<ControlPoint>) -> Classified {
        Classified::new(values(), TransferFunction::new(points).unwrap()).unwrap()
    }

    #[test]
    fn voxels_are_classified() {
        let medium = medium(vec![point(-600.0, 0.0), point(400.0, 2.0)]);
        assert_eq!((medium.lattice().dims(), medium.lattice().world_bounds().0.x), (UVec3::new(2, 3, 4), -3.5));
        let mut density = [9.0; 6];
        medium.density_slice(0, &mut density);
        // -1000 to -500.
        for (found, expected) in density.into_iter().zip([0.0, 0.0, 0.0, 0.0, 0.0, 0.2]) {
            assert!((found - expected).abs() < 1e-6, "{density:?}");
        }
        let fields = medium.optics_fields();
        let slice = |field: &OpticsField<'_>, values: usize| {
            let mut out = vec![9.0; 6 * values];
            field.slice(2, &mut out);
            out
        };
        // 200 to 700: the density of the third voxel is 2.
        let scattering = slice(fields.scattering.as_ref().unwrap(), 4);
        assert_eq!(scattering[8..12], [1.0, 2.0, 0.5, 0.0]);
        assert_eq!(slice(fields.seen.as_ref().unwrap(), 4)[8..12], [1.0, 1.0, 0.5, 0.0]);
        assert_eq!(slice(fields.emission.as_ref().unwrap(), 1), [0.0; 6]);
        assert!(fields.emission_color.is_none());
    }

    #[test]
    fn what_is_as_it_was_keeps_its_version() {
        let points = vec![point(-600.0, 0.0), point(400.0, 2.0)];
        let medium = medium(points.clone());
        let changed = |change: fn(&mut ControlPoint)| {
            let mut points = points.clone();
            change(&mut points[1]);
            let after = medium.with_function(TransferFunction::new(points).unwrap());
            let versions = |m: &Classified| [m.version, m.scattering_version, m.emission_version, m.seen_version];
            assert_eq!(after.values_version(), medium.values_version());
            let pairs = versions(&medium).into_iter().zip(versions(&after));
            pairs.map(|(a, b)| a != b).collect::<Vec<_>>()
        };
        assert_eq!(changed(|_| ()), [false, false, false, false]);
        assert_eq!(changed(|p| p.tint = Vec3::X), [false, false, false, true]);
        assert_eq!(changed(|p| p.emission = Vec3::X), [false, false, true, false]);
        assert_eq!(changed(|p| p.albedo = Vec3::X), [false, true, false, true]);
        assert_eq!(changed(|p| p.density = 1.0), [true, true, false, true]);
        assert_eq!(changed(|p| p.value = 0.0), [true, true, true, true]);
    }

    #[test]
    fn values_must_be_finite() {
        let grid = Grid::dense(UVec3::new(2, 1, 1), DAffine3::IDENTITY, vec![-1e30, f32::INFINITY]).unwrap();
        let function = TransferFunction::new(vec![ControlPoint::new(0.0, 1.0)]).unwrap();
        let error = Classified::new(Arc::new(grid), function).unwrap_err();
        assert_eq!(error.to_string(), "the value inf at voxel (1, 0, 0) is not a finite number");
    }
}
