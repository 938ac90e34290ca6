//! Buffers that become fields, by copies of rows or by a kernel.

use airlight_core::device::{Buf, Device, Field, FieldFormat, FieldSpec, ResourceId, ResourceSpec};
use airlight_core::stage::{Reduce, ReduceParams, Stage};

use super::{content, device, empty, filled};

#[test]
fn what_is_published_is_what_is_written() {
    let Some(mut device) = device() else { return };
    // Rows that the API copies, with and without other voxels behind them, and rows that it does not.
    for dims in [[64, 3, 5], [128, 2, 1], [63, 3, 5], [65, 4, 2]] {
        let spec = FieldSpec::dense(dims, 1, FieldFormat::Scalar);
        assert_eq!(device.copied_rows(&spec).is_some(), device.texels && dims[0] % 64 == 0, "{dims:?}");
        let d: &mut dyn Device = &mut device;
        let [written, published] = [0, 1].map(|id| Field { id: ResourceId(id), spec });
        let values: Vec<f32> = (0..dims.iter().product::<u32>()).map(|i| (i * 7919 % 1013) as f32).collect();
        for field in [written, published] {
            d.create(field.id, &ResourceSpec::Field(spec)).unwrap();
        }
        d.write(written.id, 0, bytemuck::cast_slice(&values)).unwrap();
        let source = filled(d, 2, &values);
        d.publish(source.id, published.id).unwrap();
        let [x, y, z] = dims;
        let mut means = |density, out| -> Vec<[f32; 2]> {
            let out: Buf<[f32; 2]> = empty(d, out, values.len());
            let params = ReduceParams::new([x, y, z, 1], [x, y, z, 0], [1.0, 1.0, 1.0, 0.0]);
            let stage = Stage::Reduce(Reduce { params, density, other: None, out });
            d.dispatch(&stage, 0..stage.axis()).unwrap();
            content(d, out)
        };
        let found = means(published, 3);
        assert_eq!(found, means(written, 4), "{dims:?}");
        assert!(found.iter().map(|[mean, _]| mean).eq(&values), "{dims:?}");
        (0..5).for_each(|id| device.destroy(ResourceId(id)));
    }
}
