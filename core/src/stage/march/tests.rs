use super::*;
use crate::device::ResourceId;
use bytemuck::Zeroable;

/// Rays of up to 44 steps (the box's diagonal is 1.3 m and a step 31 mm), two lights with columns.
fn march(samples: u32) -> March {
    let mut params = MarchParams::zeroed();
    params.dims = [8, 6, 10, 0];
    // Voxels of 0.1, 0.05 and 0.1 m, turned about z.
    (params.index_x, params.index_y) = ([6.0, 8.0, 0.0, 0.0], [-16.0, 12.0, 0.0, 0.0]);
    params.index_z = [0.0, 0.0, 10.0, 0.0];
    (params.width, params.height, params.samples) = (3, 2, samples);
    (params.scale, params.full_width, params.full_height) = (1, 3, 2);
    (params.sample_end, params.step_end) = (samples, March::ALL_STEPS);
    params.step = 0.031;
    (params.lights, params.shadow) = (2, shadow_kind::MARCH);
    let spec = FieldSpec::dense([8, 6, 10], 1, FieldFormat::Scalar);
    March {
        params,
        density: Field { id: ResourceId(0), spec },
        scattering: None,
        emission: None,
        emission_color: None,
        in_scatter: None,
        scattered: None,
        light_depth: None,
        occupancy: None,
        lights: Some(Buf::new(ResourceId(1), 2)),
        tables: Buf::new(ResourceId(2), 2 * u64::from(samples)),
        environment: None,
        surface: None,
        mesh: None,
        shadow_map: None,
        paths: Some(Buf::new(ResourceId(3), 12)),
        film: Buf::new(ResourceId(4), 12),
    }
}

#[test]
fn rays_are_as_long_as_the_box_is_across() {
    let longest = (0.8f64.powi(2) + 0.3f64.powi(2) + 1.0).sqrt();
    assert_eq!(march(1).turns().steps, (longest / 0.031).ceil() as u64 + 2);
}

#[test]
fn a_fixed_number_of_steps_is_counted_and_columns_are_not() {
    let mut fixed = march(1);
    fixed.params.steps = 7;
    let (by_step, fixed) = (march(1).turns(), fixed.turns());
    assert_eq!((fixed.steps, fixed.step), (7, by_step.step));
}

#[test]
fn a_small_film_has_a_pixel_for_every_block_of_the_full_picture() {
    let mut small = march(1);
    (small.params.scale, small.params.full_width, small.params.full_height) = (4, 9, 8);
    assert_eq!(small.validate(), Ok(()));
    small.params.full_width = 13;
    assert!(small.validate().unwrap_err().contains("scale 4"));
}

#[test]
fn rims_are_of_surfaces_that_are_bound_whole() {
    let mut rims = March { surface: Some(Buf::new(ResourceId(5), 6)), ..march(1) };
    let part = |march: &March| march.bindings().into_iter().find(|b| b.name == "surface").unwrap().part;
    rims.params.surface_samples = 1;
    assert!(part(&rims).is_some());
    rims.params.alone = alone::RIMS;
    assert_eq!((rims.validate(), part(&rims)), (Ok(()), None));
    assert!(March { surface: None, ..rims.clone() }.validate().unwrap_err().contains("without surfaces"));
    assert_eq!(rims.turns().ray, march(1).turns().ray + 25);
    rims.params.alone = 3;
    assert!(rims.validate().is_err());
}

#[test]
fn passes_take_every_step_of_every_sample_once_and_keep_to_their_turns() {
    for samples in [1, 7] {
        let march = march(samples);
        let each = march.turns();
        for turns in [each.step + each.ray + 1, 1000, 3000, each.ray(), each.ray() + 1, 3 * each.ray() + 3, u64::MAX] {
            let passes = march.passes(turns).unwrap();
            let mut next = (0, 0);
            for pass in &passes {
                assert_eq!(pass.validate(), Ok(()));
                let p = &pass.params;
                assert_eq!((p.sample_begin, p.step_begin), next);
                let steps = u64::from(p.step_end).min(each.steps) - u64::from(p.step_begin);
                let rays = u64::from(p.sample_end - p.sample_begin);
                assert!(rays * (steps * each.step + each.ray + 1) <= turns, "{turns} turns: {p:?}");
                next = if p.step_end == March::ALL_STEPS { (p.sample_end, 0) } else { (p.sample_begin, p.step_end) };
            }
            assert_eq!(next, (samples, 0), "{turns} turns");
            let cut = passes.iter().any(|pass| pass.params.step_end != March::ALL_STEPS);
            assert_eq!(cut, march.keeps_paths(turns), "{turns} turns");
        }
    }
}

#[test]
fn what_cannot_be_cut_is_said() {
    let error = march(1).passes(march(1).turns().step).unwrap_err();
    assert!(error.contains("one view step"), "{error}");
    let error = March { paths: None, ..march(1) }.passes(300).unwrap_err();
    assert!(error.contains("without paths"), "{error}");
}

#[test]
fn a_part_of_a_ray_needs_paths_and_one_sample() {
    let mut part = march(3);
    (part.params.sample_end, part.params.step_end) = (1, 5);
    assert_eq!(part.validate(), Ok(()));
    assert!(March { paths: None, ..part.clone() }.validate().is_err());
    part.params.sample_end = 2;
    assert!(part.validate().is_err());
}

#[test]
fn directions_have_no_more_harmonics_than_kernels_hold() {
    let layered = |bands: u32| {
        let mut march = March { tables: Buf::new(ResourceId(2), 1000), ..march(1) };
        (march.params.bands, march.params.cells) = (bands, [2, 2, 2, bands * bands]);
        let spec = FieldSpec::dense([2, 2, 2], bands * bands, FieldFormat::Rgba);
        march.in_scatter = Some(Field { id: ResourceId(5), spec });
        march.validate()
    };
    assert_eq!(layered(10), Ok(()));
    assert!(layered(11).unwrap_err().contains("11 bands"));
}
