//! The scattering of moments into every direction and their sweep to every cell of a coarse grid, as several estimators plan it.

use glam::Vec3;
use nalgebra::DMatrix;

use super::MediumFields;
use super::ordinates::{Carried, Ordinates};
use crate::basis::{Basis, SphericalHarmonics, healpix, pixel_integrals};
use crate::device::Buf;
use crate::exec::{Part, Plan, Solve};
use crate::scene::{Scene, Sweeps};
use crate::stage::Stage;

/// Moments of light over a coarse grid, and the operator K of `x = K(b + x)` on them (see [`sweeps`](super::sweeps)).
pub(super) struct Scattering<'a> {
    pub(super) options: Sweeps,
    pub(super) ordinates: Ordinates<'a>,
    pub(super) nside: u32,
    /// Bands that are carried: no more than the phase function reaches.
    pub(super) bands: u32,
    /// The phase function's moments, and the share of scattered light that goes on.
    pub(super) moments: Vec<f64>,
    pub(super) forward: f32,
    /// Channels of moments: 1 where nothing has a colour.
    pub(super) channels: u32,
}

impl<'a> Scattering<'a> {
    /// Moments of so many channels.
    pub(super) fn new(options: Sweeps, scene: &'a Scene, medium: &MediumFields, channels: u32) -> Self {
        let (phase, lattice) = (&scene.optics.phase, scene.medium.lattice());
        let bands = options.bands.min(phase.reach().unwrap_or(u32::MAX));
        let moments = phase.moments(bands + 1);
        // A phase function that goes below zero there scatters back, which nothing goes on from.
        let forward = moments[bands as usize].max(0.0);
        Self {
            options,
            nside: options.nside().expect("validated with the scene"),
            ordinates: Ordinates {
                scene,
                medium: *medium,
                cells: options.grid(lattice.edges() * lattice.dims().as_dvec3()),
                obstructed: None,
            },
            bands,
            moments,
            forward: forward as f32,
            channels,
        }
    }

    pub(super) fn scene(&self) -> &'a Scene {
        self.ordinates.scene
    }

    pub(super) fn coefficients(&self) -> u32 {
        self.bands * self.bands
    }

    pub(super) fn harmonics(&self) -> SphericalHarmonics {
        SphericalHarmonics::new(self.bands).expect("validated with the scene")
    }

    pub(super) fn values(&self) -> u64 {
        self.ordinates.count().saturating_mul(u64::from(self.coefficients() * self.channels))
    }

    /// Whether the extinction of one channel serves all where the share `forward` goes on.
    pub(super) fn grey(&self, forward: f32) -> bool {
        let optics = &self.scene().optics;
        let albedo = optics.albedo;
        let alike = self.ordinates.medium.scattering.is_none() && albedo.x == albedo.y && albedo.y == albedo.z;
        optics.is_grey() && (forward == 0.0 || alike)
    }

    /// Extinction per unit of density of the similar medium.
    pub(super) fn similar_extinction(&self) -> Vec3 {
        let optics = &self.scene().optics;
        optics.extinction * (1.0 - self.forward * optics.albedo)
    }

    /// Light along the pixels' centres that nothing sends yet, and its moments.
    pub(super) fn carried(&self, name: &str, optics: Buf<f32>, forward: f32, plan: &mut Plan<'a>) -> Carried {
        let (nside, harmonics) = (self.nside, self.harmonics());
        let directions = self.ordinates.directions(
            &format!("{name} directions"),
            self.options.directions,
            &nside,
            move || healpix::directions(nside),
            plan,
        );
        let count = self.options.directions * self.coefficients();
        let weights = plan.upload(&format!("{name} weights"), count.into(), &(nside, self.bands), move || {
            pixel_integrals(nside, &harmonics).iter().map(|&v| v as f32).collect()
        });
        Carried {
            optics,
            directions,
            channels: self.channels,
            grey: self.grey(forward),
            boundary: 0.0,
            emits: false,
            sources: None,
            weights: (weights, 1),
            coefficients: self.coefficients(),
            planar: true,
        }
    }

    pub(super) fn swept(&self, name: &str, of: Carried, plan: &mut Plan<'a>) -> Buf<f32> {
        let moments = plan.output(&format!("{name} moments"), self.values());
        let sweep = self.ordinates.sweep(name, of, moments, plan);
        plan.stage(Stage::Sweep(sweep));
        moments
    }

    pub(super) fn solve(&self, optics: Buf<f32>, parts: Vec<Part>, plan: &mut Plan<'a>) -> Buf<f32> {
        let source = plan.input("scattered light", self.values());
        let (nside, harmonics) = (self.nside, self.harmonics());
        let f = f64::from(self.forward);
        let beta: Vec<f64> = self.moments.iter().map(|moment| (moment - f) / (1.0 - f)).collect();
        let content = (nside, self.bands, beta.iter().map(|b| b.to_bits()).collect::<Vec<_>>());
        let count = self.options.directions * self.coefficients();
        let source_weights =
            plan.upload("scattering sources", count.into(), &content, move || source_weights(nside, &harmonics, &beta));
        let of = Carried {
            sources: Some((source, source_weights, self.coefficients())),
            ..self.carried("scattering", optics, self.forward, plan)
        };
        let scattered = plan.output("scattering moments", self.values());
        let out = plan.input("scattered moments", self.values());
        let sweep = self.ordinates.sweep("scattering", of, scattered, plan);
        plan.solve(Solve { stage: Stage::Sweep(sweep), parts, source, scattered, out, orders: self.options.orders });
        out
    }
}

/// What moments weigh toward each pixel: β'_l times the dual of the basis under the pixels' weights, so that the moments of
/// what is scattered are exactly β' times those that were.
fn source_weights(nside: u32, harmonics: &SphericalHarmonics, beta: &[f64]) -> Vec<f32> {
    let (directions, count) = (healpix::directions(nside), harmonics.count());
    let mut values = vec![0.0; count];
    let basis = DMatrix::from_row_iterator(
        directions.len(),
        count,
        directions.iter().flat_map(|&d| {
            harmonics.eval(d, &mut values);
            values.clone()
        }),
    );
    let weights = DMatrix::from_row_slice(directions.len(), count, &pixel_integrals(nside, harmonics));
    let gram = weights.transpose() * &basis;
    // The directions resolve the bands: validated with the scene.
    let dual = basis * gram.try_inverse().unwrap_or_else(|| DMatrix::identity(count, count));
    dual.row_iter().flat_map(|row| (0..count).map(|k| (row[k] * beta[k.isqrt()]) as f32).collect::<Vec<_>>()).collect()
}
