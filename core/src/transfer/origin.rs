//! What a transfer is made of.

use std::hash::{DefaultHasher, Hash, Hasher};

use xxhash_rust::xxh3::Xxh3;

use super::TransferError;
use crate::scene::Scene;

/// Hashes of what a transfer depends on, so that a stale one is refused with its reason. Camera, light, emission and tint are
/// not among them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Of the lattice and its place in the world.
    pub lattice: u128,
    /// Of the density, and of the density that scatters where that differs.
    pub density: u128,
    /// Of extinction, albedo and phase function.
    pub optics: u128,
}

impl Origin {
    /// Of a scene's medium. Reads the whole density once.
    pub fn of(scene: &Scene) -> Self {
        let (medium, optics) = (&scene.medium, &scene.optics);
        let lattice = medium.lattice();
        let (dims, world) = (lattice.dims(), lattice.index_to_world().to_cols_array());
        let mut places = Xxh3::new();
        places.update(bytemuck::cast_slice(&dims.to_array()));
        // Zero has two signs, and a medium does not.
        places.update(bytemuck::cast_slice(&world.map(|v| v + 0.0)));
        let mut density = Xxh3::new();
        let mut slice = vec![0.0f32; dims.x as usize * dims.y as usize];
        for k in 0..dims.z {
            medium.density_slice(k, &mut slice);
            density.update(bytemuck::cast_slice(&slice));
        }
        if let Some(scattering) = medium.optics_fields().scattering {
            let mut slice = vec![0.0f32; 4 * slice.len()];
            for k in 0..dims.z {
                scattering.slice(k, &mut slice);
                density.update(bytemuck::cast_slice(&slice));
            }
        }
        let mut numbers = Xxh3::new();
        let moments = optics.phase.moments(Self::PHASE_MOMENTS);
        numbers.update(bytemuck::cast_slice(&[optics.extinction.to_array(), optics.albedo.to_array()]));
        numbers.update(bytemuck::cast_slice(&moments));
        let [lattice, density, optics] = [places, density, numbers].map(|hash| hash.digest128());
        Self { lattice, density, optics }
    }

    /// Moments that tell phase functions apart.
    const PHASE_MOMENTS: u32 = 32;

    /// Whether a transfer of this origin still is that of `other`.
    ///
    /// # Errors
    /// [`TransferError::Stale`] with what changed.
    pub fn check(&self, other: &Self) -> Result<(), TransferError> {
        for (same, what) in [
            (self.lattice == other.lattice, "lattice (voxels or placement)"),
            (self.density == other.density, "density"),
            (self.optics == other.optics, "extinction, albedo or phase function"),
        ] {
            if !same {
                return Err(TransferError::Stale(what));
            }
        }
        Ok(())
    }
}

/// What tells the media of two scenes apart without reading them.
pub(crate) fn identity(scene: &Scene) -> u64 {
    let optics = &scene.optics;
    let numbers = [optics.extinction.to_array(), optics.albedo.to_array()].map(|rgb| rgb.map(f32::to_bits));
    let scattering = scene.medium.optics_fields().scattering.map(|field| field.version());
    let moments: Vec<u64> = optics.phase.moments(Origin::PHASE_MOMENTS).iter().map(|m| m.to_bits()).collect();
    let mut hash = DefaultHasher::new();
    (scene.medium.version(), scattering, numbers, moments).hash(&mut hash);
    hash.finish()
}
