//! Grids beside the density's.

use super::*;
use airlight_core::light::BlackBody;

/// What a scene of the volume in "cloud.vdb" makes of `keys`.
fn medium(keys: &str) -> LoadedScene {
    grid(&format!("file = \"cloud.vdb\"\n{keys}")).unwrap()
}

/// Slice 2 of a field of so many values a voxel.
fn slice(field: Option<airlight_core::media::OpticsField<'_>>, values: usize) -> Vec<f32> {
    let mut out = vec![9.0; 6 * values];
    field.unwrap().slice(2, &mut out);
    out
}

#[test]
fn shares_absorption_and_temperature_reach_the_medium() {
    let loaded = medium("albedo = 0.8\nalbedo_grid = \"share\"");
    assert_eq!(loaded.scene.optics.albedo, Vec3::splat(0.8));
    assert_eq!(slice(loaded.scene.medium.optics_fields().scattering, 4)[..4], [0.25, 0.25, 0.25, 0.0]);

    let loaded = medium("albedo_grid = [\"share\", \"density\", \"share\"]\nabsorption_grid = \"flames\"");
    let mut density = [0.0; 6];
    loaded.scene.medium.density_slice(1, &mut density);
    assert_eq!(density, [2.5; 6]);
    assert_eq!(slice(loaded.scene.medium.optics_fields().scattering, 4)[..4], [0.25, 0.25, 0.25, 0.0]);

    for (keys, kelvin, reference) in
        [("", 900.0, 1500.0), ("temperature_scale = 2\ntemperature_reference = 2000", 1800.0, 2000.0)]
    {
        let keys = format!("emission = 3\nemission_grid = \"flames\"\ntemperature_grid = \"heat\"\n{keys}\n{BOX}");
        let loaded = medium(&keys);
        let glow = slice(loaded.scene.medium.optics_fields().emission_color, 4);
        let expected = 2.0 * BlackBody::new(reference).color(kelvin);
        for c in 0..3 {
            assert!((f64::from(glow[c]) - expected[c]).abs() < 1e-6 * expected.x, "{glow:?} {expected}");
        }
    }
    // Nothing is asked for, and nothing is there.
    let plain = medium("albedo_grid = \"none\"\nabsorption_grid = false\ntemperature_grid = \"none\"");
    let fields = plain.scene.medium.optics_fields();
    assert!(fields.scattering.is_none() && fields.emission.is_none() && fields.emission_color.is_none());
}

#[test]
fn detail_multiplies_what_scatters() {
    let keys = "absorption_grid = \"flames\"\nemission = 1\ntemperature_grid = \"heat\"\n";
    let loaded = medium(&format!("{keys}noise = {{ scale = 0.7, contrast = 2 }}"));
    let fields = loaded.scene.medium.optics_fields();
    let (scattering, glow) = (slice(fields.scattering, 4), slice(fields.emission_color, 4));
    let mut density = [0.0; 6];
    loaded.scene.medium.density_slice(2, &mut density);
    let hot = BlackBody::new(1500.0).color(900.0).as_vec3();
    for (n, rho) in density.into_iter().enumerate() {
        assert!((scattering[4 * n] - rho * 0.5 / 2.5).abs() < 1e-6, "{scattering:?} {density:?}");
        assert!((glow[4 * n] - rho * 0.5 / 2.5 * hot.x).abs() < 1e-6, "{glow:?} {density:?}");
    }
    assert!(density.iter().any(|rho| *rho != density[0]), "{density:?}");
}

#[test]
fn grids_beside_the_density_are_told_at_their_key() {
    let told = |rest: &str| {
        let error =
            grid(&format!("file = \"cloud.vdb\"\nemission = 1\n{rest}")).map(|_| ()).expect_err(rest).to_string();
        error.strip_prefix("scenes/a.toml:").unwrap().to_owned()
    };
    for key in ["albedo_grid", "absorption_grid", "temperature_grid"] {
        let column = key.len() + 4;
        assert_eq!(
            told(&format!("{key} = \"smoke\"")),
            format!("8:{column}: medium.{key}: scenes/cloud.vdb: no grid \"smoke\"; it has density and flames")
        );
        let what = key.strip_suffix("_grid").unwrap();
        assert_eq!(
            told(&format!("{key} = \"elsewhere\"")),
            format!(
                "8:{column}: medium.{key}: scenes/cloud.vdb: the grids of density and {what} must share one transform \
                 from index to world"
            )
        );
        for (name, value) in [("broken", "-1"), ("undefined", "NaN")] {
            let right = match key {
                "albedo_grid" => format!("albedo {value} at voxel (0, 0, 0); it must be from 0 to 1"),
                "absorption_grid" => format!("density {value} at voxel (0, 0, 0); densities must be from 0 to 1e15"),
                _ => format!("temperature in kelvin {value} at voxel (0, 0, 0); it must be from 0 to 100000"),
            };
            assert_eq!(
                told(&format!("{key} = \"{name}\"")),
                format!("8:{column}: medium.{key}: scenes/cloud.vdb: {right}")
            );
        }
        assert!(told(&format!("{key} = 3")).contains(&format!("medium.{key}")), "{key}");
    }
    assert_eq!(
        told("albedo_grid = \"flames\""),
        "8:15: medium.albedo_grid: scenes/cloud.vdb: albedo 2 at voxel (0, 0, 0); it must be from 0 to 1"
    );
    assert_eq!(
        told("albedo_grid = [\"share\", \"share\"]"),
        "8:15: medium.albedo_grid = [\"share\", \"share\"]; it must be the name of a grid, or a list of three"
    );
    assert!(told("albedo_grid = [\"share\", 1, \"share\"]").contains("albedo_grid[1] must be a string"));
    assert_eq!(
        told("temperature_grid = \"heat\"\ntemperature_reference = 300"),
        "9:25: medium.temperature_reference = 300; it must be from 400 to 100000"
    );
    assert_eq!(
        told("temperature_scale = 2"),
        "8:21: medium.temperature_scale: belongs to a temperature_grid; give that too"
    );
    let error = grid("file = \"cloud.vdb\"\ntemperature_grid = \"heat\"").unwrap_err();
    assert!(
        error.ends_with("medium.temperature_grid: colours what shines; give emission, as in emission = 1"),
        "{error}"
    );
}

#[test]
fn coarser_copies_are_of_all_grids_and_stay_in_place() {
    let keys = format!("albedo_grid = \"share\"\nabsorption_grid = \"flames\"\n{BOX}");
    let (whole, coarse) = (medium(&keys), medium(&format!("coarse = 2\n{keys}")));
    let lattices = [&whole, &coarse].map(|loaded| loaded.scene.medium.lattice());
    assert!((lattices[1].edges() / lattices[0].edges() - 2.0).abs().max_element() < 1e-12);
    // The box grows to whole voxels, whose corners are corners of voxels of the file.
    let [(min, max), (low, high)] = lattices.map(|lattice| lattice.world_bounds());
    assert!((low - min).max_element() < 1e-12 && (max - high).max_element() < 1e-12, "{low} {high}");
    let apart = (min - low) / lattices[0].edges();
    assert!((apart - apart.round()).abs().max_element() < 1e-9 && apart.max_element() < 2.0, "{apart}");
    let dims = lattices[1].dims();
    let mut density = vec![0.0; (dims.x * dims.y) as usize];
    coarse.scene.medium.density_slice(0, &mut density);
    assert!(density.iter().all(|rho| *rho == 2.5), "{density:?}");
    let mut scattering = vec![9.0; 4 * density.len()];
    coarse.scene.medium.optics_fields().scattering.unwrap().slice(0, &mut scattering);
    assert_eq!(scattering[..4], [0.25, 0.25, 0.25, 0.0]);

    let told = |keys: &str| grid(&format!("file = \"cloud.vdb\"\n{keys}")).unwrap_err();
    assert_eq!(told("coarse = 3"), "scenes/a.toml:7:10: medium.coarse = 3; it must be 1, 2, 4 or 8");
    let values = "transfer_function = [{ value = 0, density = 1 }]\ncoarse = 9";
    assert!(told(values).contains("medium.coarse = 9; it must be"), "{}", told(values));
}
