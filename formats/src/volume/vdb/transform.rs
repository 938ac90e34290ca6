//! Maps from index to world.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::super::bytes::Reader;
use super::super::fault::Fault;
use super::super::text::shown;

fn vec3(r: &mut Reader<'_>) -> Result<DVec3, Fault> {
    Ok(DVec3::new(r.f64()?, r.f64()?, r.f64()?))
}

/// Reads the map's type and the map. Only the numbers that define it are used: the inverses and squares that are
/// stored beside them follow from these.
pub(super) fn read(r: &mut Reader<'_>) -> Result<DAffine3, Fault> {
    let kind = r.string().map_err(|f| f.within("transform"))?;
    let map = match kind.as_str() {
        "UniformScaleMap" | "ScaleMap" => {
            let scale = vec3(r)?;
            r.take(4 * 24)?;
            DAffine3::from_mat3(DMat3::from_diagonal(scale))
        }
        "UniformScaleTranslateMap" | "ScaleTranslateMap" => {
            let (translation, scale) = (vec3(r)?, vec3(r)?);
            r.take(4 * 24)?;
            DAffine3::from_mat3_translation(DMat3::from_diagonal(scale), translation)
        }
        "TranslationMap" => DAffine3::from_translation(vec3(r)?),
        "AffineMap" | "UnitaryMap" => {
            let mut numbers = [0.0; 16];
            for n in &mut numbers {
                *n = r.f64()?;
            }
            // Points are rows there and stand on the left: the matrix's rows are the columns of ours.
            let m = DMat4::from_cols_array(&numbers);
            let affine = m.x_axis.w == 0.0 && m.y_axis.w == 0.0 && m.z_axis.w == 0.0 && m.w_axis.w == 1.0;
            if !affine {
                return Err(Fault::Unsupported(format!("has an {kind} with a perspective part")));
            }
            DAffine3::from_mat4(m)
        }
        "NonlinearFrustumMap" => {
            return Err(Fault::Unsupported(
                "lies in a camera frustum (NonlinearFrustumMap); airlight reads affine transforms, so resample it"
                    .into(),
            ));
        }
        other => return Err(Fault::Unsupported(format!("has a transform of unknown type '{}'", shown(other)))),
    };
    let m = map.matrix3;
    let volume = m.determinant() / (m.x_axis.length() * m.y_axis.length() * m.z_axis.length());
    // What is not a number fails too.
    if map.is_finite() && volume.abs() > f64::EPSILON {
        Ok(map)
    } else {
        Err(Fault::at("transform", format!("the {kind} is singular or not finite, so its voxels have no volume")))
    }
}
